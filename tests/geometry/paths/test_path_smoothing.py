"""Smooth paths against the ones the noise was added to."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import Tolerance, WaypointTable, path_from_waypoints, zyx_to_quaternion
from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.paths.path_smoothing import smooth_positions

CIRCLE_RADIUS = 0.1


def _circle(count: int) -> np.ndarray:
    angle = 2.0 * np.pi * np.arange(count) / count
    flat = [np.cos(angle), np.sin(angle), 0.0 * angle]
    return np.stack(flat, axis=1) * CIRCLE_RADIUS + [0.8, 0.0, 1.0]


def _wave(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Open curve with an inflection, by its parameter."""
    u = np.linspace(0.0, 0.6, count)
    waves = [0.8 + 0.05 * np.sin(u / 0.08), u, 1.0 + 0.03 * np.cos(u / 0.1)]
    return u, np.stack(waves, axis=1)


def _curvature(curve: Curve, theta: np.ndarray) -> np.ndarray:
    _, d1, d2 = curve.derivatives(theta, 2).transpose(1, 0, 2)
    return np.linalg.norm(np.cross(d1, d2), axis=1) / np.linalg.norm(d1, axis=1) ** 3


def _distances(curve: Curve, points: np.ndarray) -> np.ndarray:
    sigma, slope = curve.derivatives(np.linspace(*curve.domain, 40_001), 1).transpose(1, 0, 2)
    nearest = cKDTree(sigma).query(points)[1]
    off, slope = points - sigma[nearest], slope[nearest]
    along = np.sum(off * slope, axis=1, keepdims=True) / np.sum(slope**2, axis=1, keepdims=True)
    return np.linalg.norm(off - along * slope, axis=1)


@pytest.mark.slow(but=["0.0002-0.001-5", "2e-05-0.0001-3", "0.0-1e-05-5"])
@pytest.mark.parametrize("smoothness", [3, 5])
@pytest.mark.parametrize(("noise", "tolerance"), [(2e-4, 1e-3), (2e-5, 1e-4), (0.0, 1e-5)])
def test_a_noisy_circle_is_a_circle_again(smoothness: int, noise: float, tolerance: float) -> None:
    """628 points 1 mm apart; all derivatives up to the fifth against r^(1 - k)."""
    points = _circle(628) + noise * np.random.default_rng(1).normal(size=(628, 3))
    curve, theta = smooth_positions(points, smoothness=smoothness, tolerance=tolerance, closed=True)
    assert (curve.closed, curve.smoothness) == (True, smoothness)
    assert _distances(curve, points).max() <= tolerance
    at_points = curve.derivatives(theta, 0)[:, 0]
    assert np.linalg.norm(at_points - points, axis=1).max() <= tolerance
    grid = np.linspace(*curve.domain, 3000)
    np.testing.assert_allclose(_curvature(curve, grid), 1.0 / CIRCLE_RADIUS, rtol=0.02)
    values = curve.derivatives(grid, smoothness)
    for order in range(1, smoothness + 1):
        sizes = np.linalg.norm(values[:, order], axis=1)
        allowed = 0.3 if order == smoothness else 0.1
        np.testing.assert_allclose(sizes, CIRCLE_RADIUS ** (1 - order), rtol=allowed)
    # the parameter is the arc length
    assert curve.period == pytest.approx(2.0 * np.pi * CIRCLE_RADIUS, rel=5e-3)
    assert theta[0] == 0.0


@pytest.mark.slow(but=["0.0002-0.001-3", "2e-05-0.0001-5"])
@pytest.mark.parametrize("smoothness", [3, 5])
@pytest.mark.parametrize(("noise", "tolerance"), [(2e-4, 1e-3), (2e-5, 1e-4)])
def test_a_noisy_wave(smoothness: int, noise: float, tolerance: float) -> None:
    u, truth = _wave(700)
    points = truth + noise * np.random.default_rng(2).normal(size=truth.shape)
    curve, theta = smooth_positions(
        points, smoothness=smoothness, tolerance=tolerance, closed=False
    )
    assert curve.smoothness == smoothness
    assert theta[0] == 0.0
    assert theta[-1] == pytest.approx(curve.domain[1], rel=1e-12)
    assert _distances(curve, points).max() <= tolerance
    # starts and ends where the points do
    ends = curve.derivatives(np.array(curve.domain), 0)[:, 0]
    assert np.linalg.norm(ends - points[[0, -1]], axis=1).max() <= tolerance
    # between the points nothing is hidden: the curvature is the true one
    slope = np.stack([0.05 / 0.08 * np.cos(u / 0.08), 1.0 + 0.0 * u, -0.3 * np.sin(u / 0.1)], 1)
    bend = np.stack([-0.05 / 0.08**2 * np.sin(u / 0.08), 0.0 * u, -3.0 * np.cos(u / 0.1)], 1)
    expected = np.linalg.norm(np.cross(slope, bend), axis=1) / np.linalg.norm(slope, axis=1) ** 3
    grid = np.linspace(*curve.domain, 5000)
    found = _curvature(curve, grid)
    assert found.max() < 1.15 * expected.max()
    nearest = cKDTree(truth).query(curve.derivatives(grid, 0)[:, 0])[1]
    # an end has neighbours on one side only, and may use up the tolerance
    assert np.abs(found - expected[nearest])[500:-500].max() < 0.05 * expected.max()
    speed = np.linalg.norm(curve.derivatives(grid, 1)[:, 1], axis=1)
    np.testing.assert_allclose(speed, 1.0, atol=0.03)


@pytest.mark.slow
def test_a_rest_while_recording_does_not_matter() -> None:
    """A recorder goes on while the hand stands still, and repeats points."""
    _, truth = _wave(600)
    rng = np.random.default_rng(3)
    still = np.repeat(truth[300:301], 200, axis=0)
    points = np.vstack([truth[:300], still, truth[300:], truth[-1:]])
    points += 1e-4 * rng.normal(size=points.shape)
    points = np.repeat(points, 2, axis=0)
    curve, _ = smooth_positions(points, smoothness=5, tolerance=6e-4, closed=False)
    grid = np.linspace(*curve.domain, 3000)
    speed = np.linalg.norm(curve.derivatives(grid, 1)[:, 1], axis=1)
    np.testing.assert_allclose(speed, 1.0, atol=0.05)
    assert _curvature(curve, grid).max() < 12.0


def test_corners_are_followed_within_the_tolerance() -> None:
    """Points of a machined outline, 1 mm apart and without noise."""
    side = np.arange(0.0, 0.1, 1e-3)
    low, right = np.stack([side, 0 * side], 1), np.stack([0.1 + 0 * side, side], 1)
    outline = np.vstack([low, right, [0.1, 0.1] - low, [0.1, 0.1] - right])
    points = np.column_stack([outline, 0.5 + 0.0 * outline[:, 0]])
    curve, _ = smooth_positions(points, smoothness=3, tolerance=5e-4, closed=True)
    assert _distances(curve, points).max() <= 5e-4
    grid = curve.derivatives(np.linspace(*curve.domain, 4000), 0)[:, 0]
    beyond = np.maximum(np.abs(grid[:, 0] - 0.05), np.abs(grid[:, 1] - 0.05)) - 0.05
    assert beyond.max() <= 5e-4


@pytest.mark.parametrize("closed", [False, True])
def test_orientation_is_smoothed_with_the_position(closed: bool) -> None:
    rng = np.random.default_rng(4)
    count = 500
    part = np.arange(count) / count
    # one turn a revolution: the quaternion of a closed path returns with its sign flipped
    angles = np.stack([2 * np.pi * part, 0.2 * np.sin(4 * np.pi * part), 0.0 * part], axis=1)
    noisy = angles + np.radians(0.2) * rng.normal(size=angles.shape)
    points = _circle(count) + 1e-4 * rng.normal(size=(count, 3))
    q = zyx_to_quaternion(noisy) * rng.choice([-1.0, 1.0], (count, 1))
    path = path_from_waypoints(
        WaypointTable(points, q),
        smoothness=5,
        closed=closed,
        tolerance=Tolerance(5e-4, np.radians(0.9)),
    )
    path.require_smoothness(5, "elastic joints")
    assert path.orientation is not None
    assert path.orientation.smoothness == 5
    theta = path.waypoints.parameters
    found = path.orientation.derivatives(theta, 0)[:, 0]
    found /= np.linalg.norm(found, axis=1, keepdims=True)

    def largest(quaternions: np.ndarray) -> float:
        cosines = np.abs(np.sum(found * quaternions, axis=1))
        return float(np.degrees(2.0 * np.arccos(np.minimum(1.0, cosines)).max()))

    assert largest(q) <= 0.9
    assert largest(zyx_to_quaternion(angles)) < 0.9
    if closed:
        assert path.orientation.period == pytest.approx(2.0 * path.position.period)
    # its rates are those of the angles, not of the noise
    rates = path.orientation.derivatives(np.linspace(0, path.position.domain[1], 2000), 2)
    turning = 2.0 * np.linalg.norm(rates[:, 1], axis=1) * CIRCLE_RADIUS
    assert turning.max() < 1.25 * np.hypot(1.0, 0.4)


@pytest.mark.slow
def test_a_tolerance_below_the_noise_says_what_to_write() -> None:
    points = _circle(628) + 2e-4 * np.random.default_rng(1).normal(size=(628, 3))
    with pytest.raises(InputError, match=r"path\.shape\.tolerance = 5e-05 m: .* allow") as caught:
        smooth_positions(points, smoothness=3, tolerance=5e-5, closed=True)
    advice = float(str(caught.value).split("allow ")[1].split()[0])
    curve, _ = smooth_positions(points, smoothness=3, tolerance=advice, closed=True)
    assert _distances(curve, points).max() <= advice
    np.testing.assert_allclose(
        _curvature(curve, np.linspace(*curve.domain, 2000)), 1.0 / CIRCLE_RADIUS, rtol=0.1
    )


def test_points_that_say_too_little() -> None:
    with pytest.raises(InputError, match="waypoints: 3 different; at least 6"):
        smooth_positions(
            np.repeat(np.eye(3), 4, axis=0), smoothness=4, tolerance=1e-3, closed=False
        )
    with pytest.raises(InputError, match="is too much for a path whose waypoints reach"):
        smooth_positions(_circle(50), smoothness=3, tolerance=0.5, closed=True)


def test_a_tolerance_is_a_number_too() -> None:
    points = _circle(200) + 1e-4 * np.random.default_rng(4).normal(size=(200, 3))
    table = WaypointTable(points, zyx_to_quaternion(np.zeros((200, 3))))
    message = path_from_waypoints(table, smoothness=3, tolerance=Tolerance(5e-4, np.radians(1.0)))
    short = path_from_waypoints(table, smoothness=3, tolerance=5e-4)
    theta = np.linspace(*message.position.domain, 50)
    for one, other in (
        (message.position, short.position),
        (message.orientation, short.orientation),
    ):
        np.testing.assert_array_equal(one.derivatives(theta, 2), other.derivatives(theta, 2))
    with pytest.raises(InputError, match="tolerance"):
        path_from_waypoints(table, smoothness=3, tolerance=-1.0)
