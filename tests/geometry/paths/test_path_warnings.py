"""What is said of paths that are not what their makers meant."""

import numpy as np
import pytest

from pfsc_drake.geometry import (
    OrientationCurve,
    Path,
    PiecewisePolynomialCurve,
    Tolerance,
    WaypointTable,
    interpolate_orientation,
    path_from_waypoints,
    shape_report,
    zyx_to_quaternion,
)
from pfsc_drake.geometry.paths.path_warnings import closing_gap, path_warnings, turning_back

ANGLE = np.linspace(0.0, 2.0, 241)
WAVE = np.stack([0.3 * np.cos(ANGLE), 0.3 * np.sin(ANGLE), 0.1 * np.sin(2.0 * ANGLE)], axis=1)
U_TURN = np.array(
    [[0, k / 10, 0] for k in range(5)]
    + [[0, 0.4, 0.1]]
    + [[0, 0.4 - k / 10, 0.2] for k in range(5)]
)


def warnings(points, **options):
    path = path_from_waypoints(WaypointTable(np.asarray(points, float)), **options)
    return path_warnings(path, shape_report(path))


@pytest.mark.parametrize("smoothness", [3, 5])
def test_smooth_paths_pass_in_silence(smoothness):
    assert warnings(WAVE, smoothness=smoothness) == []
    assert warnings(WAVE[::16], smoothness=smoothness) == []
    circle = np.stack([np.cos(ANGLE * np.pi), np.sin(ANGLE * np.pi), 0 * ANGLE], axis=1)
    for step in (4, 30):
        assert warnings(circle[:-1:step], smoothness=smoothness, closed=True) == []
    line = PiecewisePolynomialCurve.line([0, 0, 0], [0, 0.5, 0])
    path = Path(line, OrientationCurve.fixed([1, 0, 0, 0], line.domain))
    assert path_warnings(path, shape_report(path)) == []


@pytest.mark.parametrize("smoothness", [3, 5])
@pytest.mark.parametrize("noise", [2e-5, 2e-4])
def test_noise(smoothness, noise):
    angle = np.linspace(0.0, 0.12, 40)  # 1 mm apart
    points = 0.3 * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    points += noise * np.random.default_rng(0).normal(size=points.shape)
    (sentence,) = warnings(points, smoothness=smoothness)
    assert "bends to and fro" in sentence
    # what is advised works, and leaves nothing to complain of
    advice = float(sentence.rsplit(" ", 1)[1])
    assert 3.0 * noise < advice < 20.0 * noise
    tolerance = Tolerance(advice, 0.01)
    assert warnings(points, smoothness=smoothness, tolerance=tolerance) == []


def test_corners_that_swing():
    (sentence,) = warnings(U_TURN, smoothness=5)
    assert "overshoots" in sentence
    assert "100 mm apart" in sentence
    assert "path.shape.corner_distance" in sentence
    assert warnings(U_TURN, smoothness=5, corner_distance=0.03) == []


def test_a_corner_that_bends_narrowly():
    points = [[0, k / 10, 0] for k in range(6)] + [[k / 10, 0.5, 0] for k in range(1, 6)]
    (sentence,) = warnings(points, smoothness=3)
    assert "bends with a radius of" in sentence
    assert "where waypoints are 100 mm apart" in sentence


def test_ends_that_meet():
    angle = 2.0 * np.pi * np.arange(40) / 40
    circle = 0.1 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    for points in (circle, np.vstack([circle, circle[:1]])):
        (sentence,) = warnings(points, smoothness=3)
        assert sentence.endswith("write path.shape.closed: true")
        assert warnings(points, smoothness=3, closed=True) == []
    path = path_from_waypoints(WaypointTable(circle[:30]), smoothness=3)
    assert closing_gap(path) is None


def test_millimetres():
    (sentence,) = warnings(1e3 * WAVE, smoothness=3)
    assert "299.9" not in sentence
    assert "up to 300 m from the origin; if they are in mm write unit: mm" in sentence


def test_orientation_that_turns_faster_than_its_waypoints():
    """Keyframes on uneven places: the spline through them overshoots."""
    line = PiecewisePolynomialCurve.line([0, 0, 0], [0, 1.0, 0])
    theta = np.array([0.0, 0.3, 0.6, 0.62, 0.64, 0.9, 1.0])
    angles = np.radians(
        [[0, 0, 0], [0, 0, 0], [0, 0, 0], [60, 0, 0], [0, 0, 0], [0, 0, 0], [0] * 3]
    )
    curve = interpolate_orientation(zyx_to_quaternion(angles), theta, smoothness=3)
    path = Path(line, curve)
    (sentence,) = path_warnings(path, shape_report(path))
    assert sentence.startswith("the orientation turns by")
    assert sentence.endswith("add orientations there")


def test_nearly_coincident_waypoints():
    """Their direction is chance, and so is the path's: the two are named, not what comes of it."""
    points = np.array([[0.8 + 0.05 * k, 0.0, 0.9] for k in range(6)] + [[1.1, 0.1, 0.9]])
    points[4] = points[3] - [1e-6, 0.0, 0.0]
    (sentence,) = warnings(points, smoothness=5)
    assert "waypoints 4 and 5 are 1 um apart, others 50 mm" in sentence
    assert "take one of the two out, or write path.shape.tolerance" in sentence
    tolerance = Tolerance(1e-3, 0.01)
    assert "waypoints" not in "".join(warnings(points, smoothness=5, tolerance=tolerance))
    # harmless where the path goes on
    points = np.array([[0.8 + 0.05 * k, 0.0, 0.9] for k in range(6)])
    points = np.insert(points, 3, points[3] - [1e-6, 0.0, 0.0], axis=0)
    assert warnings(points, smoothness=5) == []


def test_a_path_that_turns_back_on_itself():
    points = np.array([[0.8, 0.0, 0.9], [0.9, 0.0, 0.9], [1.0, 0.0, 0.9], [0.9, 0.0, 0.9]])
    sentence = turning_back(points)
    assert "by 180 deg at waypoint 3" in sentence
    assert "reference.points: [0, LENGTH, 0]" in sentence
    assert turning_back(points[:3]) is None
    assert turning_back(points[:2]) is None
    assert turning_back(points + 0.01 * np.diag([0, 0, 0, 1])[:, [0, 3, 1]]) is None
    assert turning_back(WAVE) is None


@pytest.mark.slow
def test_a_tolerance_that_would_be_refused_is_not_advised():
    """Scatter as large as the path: five times the noise is more than the whole way."""
    advised = 0
    for seed in range(8):
        points = 0.05 * np.random.default_rng(seed).normal(size=(24, 3))
        points[:, 0] += np.linspace(0.0, 0.3, 24)
        for sentence in warnings(points, smoothness=3):
            assert "write path.shape.tolerance" not in sentence
            advised += "too short for their scatter" in sentence
    assert advised > 0


def test_lines_too_short_for_the_corner_distance():
    """Of a rectangle of 30 by 100 mm, whose corners are rounded by 15 mm at most."""
    points = [[0, 0, 0], [0.1, 0, 0], [0.1, 0.03, 0], [0, 0.03, 0]]
    options = {"smoothness": 3, "closed": True}
    (sentence,) = warnings(points, corner_distance=0.02, **options)
    assert "corner_distance = 0.02 m is more than half of 2 of 4 lines" in sentence
    assert "between waypoints 2 and 3, has 0.03 m" in sentence
    (sentence,) = warnings(points, corner_distance=0.06, **options)
    assert "4 of 4 lines" in sentence
    assert warnings(points, corner_distance=0.015, **options) == []
