"""Metrics of a path's shape."""

import numpy as np
import pytest

from experiments.results.shape_metrics import shape_metrics
from pfsc_drake.geometry import (
    FourierCurve,
    OrientationCurve,
    Path,
    PiecewisePolynomialCurve,
    WaypointTable,
    path_from_waypoints,
    shape_report,
)


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
