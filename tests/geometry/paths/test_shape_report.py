"""Numbers of a path's shape against closed forms and finite differences."""

import math

import numpy as np
import pytest

from pfsc_drake.geometry import (
    FourierCurve,
    OrientationCurve,
    Path,
    PiecewisePolynomialCurve,
    WaypointTable,
    interpolate_orientation,
    path_from_waypoints,
    shape_report,
    zyx_to_quaternion,
)


def test_circle() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 25)
    turn = zyx_to_quaternion(np.stack([angle, 0 * angle, 0 * angle], axis=1))
    turning = interpolate_orientation(turn, angle, smoothness=5, closed=True)
    report = shape_report(Path(FourierCurve.circle([0, 0, 0], 0.2), turning))
    assert report.length == pytest.approx(0.4 * np.pi)
    assert report.smallest_radius == pytest.approx(0.2)
    assert report.largest_curvature_rate == pytest.approx(1.0 / 0.2**2)
    assert report.largest_angle_rate == pytest.approx(5.0, rel=1e-4)
    assert report.distance_from_points is report.distance_from_polygon is None


def test_straight_line() -> None:
    line = PiecewisePolynomialCurve.line([0, 0, 0], [0, 0.5, 0])
    report = shape_report(Path(line, OrientationCurve.fixed([1, 0, 0, 0], line.domain)))
    assert report.smallest_radius == math.inf
    assert report.largest_angle_rate == 0.0


def test_position_of_the_narrowest_bend_and_its_rate(twisted: FourierCurve) -> None:
    path = Path(twisted)
    report = shape_report(path)
    s = np.linspace(0.0, path.length, 8001)
    theta = np.array([path.arc_length.parameter(value) for value in s[:-1].tolist()])
    sigma = twisted.derivatives(theta, 0)[:, 0]
    h = s[1]
    bend = (np.roll(sigma, -1, 0) - 2 * sigma + np.roll(sigma, 1, 0)) / h**2
    size = np.linalg.norm(bend, axis=1)
    assert 1.0 / report.smallest_radius == pytest.approx(size.max(), rel=1e-4)
    assert report.smallest_radius_at == pytest.approx(s[np.argmax(size)], abs=2e-3)
    rate = np.linalg.norm(np.roll(bend, -1, 0) - np.roll(bend, 1, 0), axis=1) / (2 * h)
    assert report.largest_curvature_rate == pytest.approx(rate.max(), rel=1e-3)


@pytest.mark.parametrize("closed", [False, True])
def test_distance_from_the_polygon(closed: bool) -> None:
    """Of a circle through 12 points: the sagitta of its arcs."""
    angle = 2.0 * np.pi * np.arange(12) / 12
    points = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    path = path_from_waypoints(WaypointTable(points), smoothness=3, closed=closed)
    report = shape_report(path)
    assert report.distance_from_points == pytest.approx(0.0, abs=1e-12)
    assert report.distance_from_polygon == pytest.approx(1.0 - math.cos(np.pi / 12), rel=0.03)
    assert report.chord_there == pytest.approx(2.0 * math.sin(np.pi / 12))
    place = path.arc_length.parameter(report.distance_from_polygon_at)
    sigma = path.position.derivatives(place, 0)[0]
    starts = points if closed else points[:-1]
    sides = np.roll(points, -1, 0)[: len(starts)] - starts
    along = np.clip(np.sum((sigma - starts) * sides, 1) / np.sum(sides**2, 1), 0.0, 1.0)
    off = np.linalg.norm(sigma - starts - along[:, None] * sides, axis=1).min()
    assert off == pytest.approx(report.distance_from_polygon, rel=1e-9)


@pytest.mark.parametrize("closed", [False, True])
def test_distance_of_noisy_points_from_a_smooth_path(closed: bool) -> None:
    """Against a search over all of the path."""
    rng = np.random.default_rng(2)
    angles = 2.0 * np.pi * np.arange(60) / 60.0
    points = np.stack([0.3 * np.cos(angles), 0.3 * np.sin(angles), 0.1 * np.sin(2 * angles)], 1)
    points += rng.uniform(-1e-3, 1e-3, points.shape)
    path = path_from_waypoints(WaypointTable(points), smoothness=3, closed=closed, tolerance=2e-3)
    near = path.position.derivatives(np.linspace(*path.position.domain, 20_001), 0)[:, 0]
    found = max(np.linalg.norm(near - point, axis=1).min() for point in points)
    missed = shape_report(path).distance_from_points
    assert missed is not None
    # samples are up to 0.06 mm beside the closest point
    assert found - 2e-6 < missed <= found + 1e-12
    assert 2e-4 < missed <= 2e-3


def test_distance_of_rounded_corners() -> None:
    points = np.array([[0.0, 0, 0], [1.0, 0, 0], [1.0, 1.0, 0]])
    path = path_from_waypoints(WaypointTable(points), smoothness=3, corner_distance=0.1)
    near = path.position.derivatives(np.linspace(*path.position.domain, 20_001), 0)[:, 0]
    found = np.linalg.norm(near - points[1], axis=1).min()
    assert shape_report(path).distance_from_points == pytest.approx(found, abs=1e-7)
