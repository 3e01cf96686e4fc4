"""The view of path and way: equal scales, both ends."""

import numpy as np
import pytest

from experiments.figures.all import draw_figures
from experiments.figures.path import draw_notch_position, draw_path, draw_surface_fit
from experiments.results.run_log import RunLog
from pfsc_drake.geometry.surfaces.penalized_surface import Residuals

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


@pytest.fixture(name="log")
def fixture_log():
    log = RunLog(np.linspace(0.0, 1.0, 5))
    log.add(
        "notch_position",
        [[0, 0], [1e-3, 0], [2e-3, -1e-3], [np.nan, np.nan], [-3e-3, 1e-3]],
        "m",
        ["left", "above"],
        2e-3,
    )
    return log


def test_left_is_left(log):
    (panel,) = draw_notch_position(log).canvas.axes
    way = panel.lines[0]
    np.testing.assert_allclose(way.get_xdata(), [0.0, -1.0, -2.0, np.nan, 3.0])
    np.testing.assert_allclose(way.get_ydata(), [0.0, 0.0, -1.0, np.nan, 1.0])
    assert "mm" in panel.get_xlabel() and "mm" in panel.get_ylabel()


def test_free_circle_and_all_of_the_way_are_in_the_picture(log):
    (panel,) = draw_notch_position(log).canvas.axes
    circle = next(line for line in panel.lines if line.get_label() == "free of contact")
    np.testing.assert_allclose(np.hypot(circle.get_xdata(), circle.get_ydata()), 2.0)
    low, high = panel.get_xlim()
    assert low < -3.0 and high > 3.0 and panel.get_ylim() == (low, high)


def test_is_drawn_when_logged(log):
    log.add("y_t", np.zeros((5, 3)), "m")
    assert "notch" in [drawing.name for drawing in draw_figures(log, [np.zeros((2, 3))])]


GENERATOR = np.random.default_rng(0)
FIT = Residuals(GENERATOR.uniform(0.0, 1.0, (500, 2)), 1e-3 * GENERATOR.normal(size=500))


def test_every_point_is_shown_where_it_is_and_counted():
    drawing = draw_surface_fit(FIT)
    over, counted = drawing.canvas.axes[:2]
    (dots,) = over.collections
    np.testing.assert_array_equal(dots.get_offsets(), FIT.theta)
    np.testing.assert_allclose(dots.get_array(), 1e3 * FIT.distances)
    low, high = dots.get_clim()
    assert low == -high < -1e3 * FIT.largest
    assert sum(bar.get_height() for bar in counted.patches) == 500
    assert "500 points" in drawing.caption
    marks = sorted(line.get_xdata()[0] for line in counted.lines)
    assert marks == pytest.approx([-1e3 * FIT.rms, 1e3 * FIT.rms])


def test_points_on_the_surface():
    drawing = draw_surface_fit(Residuals(FIT.theta, np.zeros(500)))
    assert "at most 0" in drawing.caption


@pytest.mark.slow
def test_it_is_drawn_of_surfaces_that_were_fitted(drawn_log):
    names = [drawing.name for drawing in draw_figures(drawn_log, [np.zeros((2, 3))], FIT)]
    assert names[:2] == ["path", "surface_fit"]
    assert "surface_fit" not in [d.name for d in draw_figures(drawn_log, [np.zeros((2, 3))])]
