"""Shape of paths and surfaces: metrics and figures."""

import numpy as np
import pytest

from experiments.results.features import draw_figures
from experiments.results.shape_feature import draw_path, draw_surface_fit, shape_metrics
from pfsc_drake.geometry import (
    FourierCurve,
    OrientationCurve,
    Path,
    PiecewisePolynomialCurve,
    WaypointTable,
    path_from_waypoints,
    shape_report,
)
from pfsc_drake.geometry.surfaces.penalized_surface import Residuals


def test_what_exists_is_given():
    circle = Path(FourierCurve.circle([0, 0, 0], 0.2))
    metrics = shape_metrics(shape_report(circle))
    assert metrics["path_length"].value == pytest.approx(0.4 * np.pi)
    assert metrics["path_smallest_radius"].value == pytest.approx(0.2)
    assert {metric.unit for metric in metrics.values()} == {"m"}
    assert set(metrics) == {"path_length", "path_smallest_radius", "path_smallest_radius_at"}
    line = PiecewisePolynomialCurve.line([0, 0, 0], [1, 0, 0])
    straight = Path(line, OrientationCurve.fixed([1, 0, 0, 0], line.domain))
    assert set(shape_metrics(shape_report(straight))) == {"path_length", "path_angle_rate"}
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    path = path_from_waypoints(WaypointTable(points), smoothness=3, closed=True)
    report = shape_report(path)
    metrics = shape_metrics(report)
    assert metrics["path_distance_from_points"].value == report.distance_from_points
    assert metrics["path_distance_from_polygon"].value == report.distance_from_polygon


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
