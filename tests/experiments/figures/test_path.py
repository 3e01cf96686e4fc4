"""The view of path and way: equal scales, both ends."""

import numpy as np

from experiments.figures.path import draw_path

PATH = np.stack([np.linspace(0.0, 0.3, 50), np.zeros(50), np.full(50, 0.5)], axis=1)


def test_path_has_equal_scales_and_both_ends(drawn_log):
    axes = draw_path(drawn_log, [PATH]).canvas.axes[0]
    limits = np.array([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])
    aspect = np.asarray(axes.get_box_aspect())
    scale = aspect / (limits[:, 1] - limits[:, 0])
    np.testing.assert_allclose(scale, scale[0], rtol=1e-9)
    ends = {line.get_label(): np.array(line.get_data_3d())[:, 0] for line in axes.lines}
    np.testing.assert_allclose(ends["start"], [0.0, 0.01, 0.5])
    np.testing.assert_allclose(ends["end"], drawn_log["y_t"].values[-1])


def test_the_longer_side_runs_across_the_picture(drawn_log):
    along_x = draw_path(drawn_log, [PATH]).canvas.axes[0]
    swap = [1, 0, 2]
    drawn_log["y_t"].values = drawn_log["y_t"].values[:, swap]
    along_y = draw_path(drawn_log, [PATH[:, swap]]).canvas.axes[0]
    assert not any(line.get_clip_on() for line in along_y.lines)
    # seen from an azimuth a, x runs across by |sin a| of its length and y by |cos a|
    assert abs(np.sin(np.deg2rad(along_x.azim))) > 0.8
    assert abs(np.cos(np.deg2rad(along_y.azim))) > 0.8
