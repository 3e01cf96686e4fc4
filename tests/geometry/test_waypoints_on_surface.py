"""Curves through waypoints on a surface, against closed forms."""

import math

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import angle_between, zyx_to_matrix
from pfsc_drake.geometry.path_on_surface import (
    curve_through,
    normal_orientation,
    path_on_surface,
    project_waypoints,
)
from pfsc_drake.geometry.paths.geometric_path import PathTarget
from pfsc_drake.geometry.shapes.cylinder import cylinder
from pfsc_drake.geometry.shapes.paraboloid import paraboloid

RADIUS = 0.2
TUBE = cylinder(RADIUS, (-0.5, 0.5))
DISH = paraboloid(((-0.3, 0.3), (-0.4, 0.4)), 0.5)
EIGHT = [[0.1 * math.sin(2 * a), 0.2 * math.sin(a)] for a in np.arange(14) * math.pi / 7]


def on_tube(angle, height):
    return np.stack([RADIUS * np.cos(angle), RADIUS * np.sin(angle), height], axis=-1)


def test_two_waypoints_on_a_cylinder_make_a_helix():
    """Two and a half revolutions; their length is a helix's."""
    curve = curve_through(TUBE, [[0.3, -0.2], [1.3, -0.1], [15.3, 0.3]][::2], smoothness=5)
    path = path_on_surface(TUBE, curve)
    assert path.length == pytest.approx(math.hypot(15.0 * RADIUS, 0.5), rel=1e-9)
    assert path.position.smoothness >= 5
    angle = np.linspace(0.3, 15.3, 40)
    theta = curve.domain[0] + (angle - 0.3) / 15.0 * (curve.domain[1] - curve.domain[0])
    points = path.position.derivatives(theta, 0)[:, 0]
    np.testing.assert_allclose(points, on_tube(angle, -0.2 + (angle - 0.3) / 30.0), atol=1e-12)


@pytest.mark.parametrize("repeated", [False, True])
def test_a_closed_curve_visits_its_waypoints(repeated):
    points = EIGHT + EIGHT[:1] * repeated
    curve = curve_through(DISH, points, smoothness=5, closed=True)
    assert curve.closed
    assert curve.smoothness >= 5
    # as far apart as in space
    x, y = np.array([*EIGHT, EIGHT[0]]).T
    chords = np.diff(np.stack([x, y, 0.5 * (x**2 + y**2)], axis=1), axis=0)
    at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(chords, axis=1))])
    np.testing.assert_allclose(curve.derivatives(at[:-1], 0)[:, 0], EIGHT, atol=1e-12)
    assert curve.domain[1] == pytest.approx(at[-1])


def test_points_near_the_surface_are_put_on_it():
    angle = np.linspace(2.0, 9.0, 40)  # past the seam twice
    height = 0.02 * angle
    beside = on_tube(angle, height) * [1.002, 1.002, 1.0]
    thetas = project_waypoints(TUBE, beside, 1e-3, closed=False)
    revolution = thetas[0, 0] - angle[0]
    assert abs(revolution / (2.0 * math.pi) - round(revolution / (2.0 * math.pi))) < 1e-12
    np.testing.assert_allclose(
        thetas - [revolution, 0.0], np.stack([angle, height], axis=1), atol=1e-9
    )
    with pytest.raises(InputError, match=r"waypoint 1:.* 0\.4 mm .* at most 0\.3 mm"):
        project_waypoints(TUBE, beside, 0.3e-3, closed=False)
    ring = on_tube(np.arange(12) * math.pi / 6, np.zeros(12))
    with pytest.raises(InputError, match=r"round the surface in theta_1.*leave it open"):
        project_waypoints(TUBE, ring, 1e-3, closed=True)
    with pytest.raises(InputError, match="50 mm from the surface, beside its border"):
        project_waypoints(TUBE, [on_tube(0.1, 0.55)], 1e-3, closed=False)
    with pytest.raises(InputError, match=r"waypoint 1:.*no closest point"):
        project_waypoints(TUBE, [[0.0, 0.0, 0.1]], 1.0, closed=False)


@pytest.mark.parametrize("smoothness", [3, 5])
def test_the_orientation_is_that_of_the_frame(smoothness):
    """Tangents and normal of the dish z = 0.5 (x^2 + y^2) in closed form."""
    offset = zyx_to_matrix([0.4, -1.0, 3.0])
    curve = curve_through(DISH, EIGHT, smoothness=smoothness, closed=True)
    orientation = normal_orientation(DISH, curve, offset, smoothness=smoothness)
    assert orientation.smoothness >= smoothness
    theta = np.linspace(*curve.domain, 501)
    x, y = curve.derivatives(theta, 0)[:, 0].T
    first = np.stack([np.ones_like(x), 0.0 * x, x], axis=1)
    normal = np.stack([-x, -y, np.ones_like(x)], axis=1)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    frame = np.stack([first, np.cross(normal, first), normal], axis=2)
    expected, result = frame @ offset, orientation.rotation_matrix(theta)
    for k in range(3):
        assert angle_between(result[:, :, k], expected[:, :, k]).max() < 2e-6


def test_wrong_waypoints():
    with pytest.raises(InputError, match="pairs"):
        curve_through(DISH, [[0.0, 0.1]], smoothness=3)
    with pytest.raises(InputError, match="pairs"):
        curve_through(DISH, [[0.0, 0.1, 0.2], [0.1, 0.0, 0.0]], smoothness=3)
    with pytest.raises(InputError, match="coincide"):
        curve_through(DISH, [[0.0, 0.1], [0.0, 0.1], [0.1, 0.1]], smoothness=3)
    with pytest.raises(InputError, match="2 distinct for a closed curve; at least 3"):
        curve_through(DISH, [[0.0, 0.1], [0.1, 0.1], [0.0, 0.1]], smoothness=3, closed=True)
    with pytest.raises(InputError, match=r"theta_1: 0\.31"):
        curve_through(DISH, [[0.0, 0.1], [0.31, 0.1]], smoothness=3)
    with pytest.raises(InputError, match="offset"):
        curve = curve_through(DISH, [[0.0, 0.1], [0.1, 0.1]], smoothness=3)
        normal_orientation(DISH, curve, 2.0 * np.eye(3), smoothness=3)


def test_a_point_beside_the_path_moves_with_the_normal():
    """Its velocity against central differences, on a path of geodesic torsion."""
    curve = curve_through(TUBE, [[0.0, -0.2], [4.0, 0.3]], smoothness=3)
    target = PathTarget(path_on_surface(TUBE, curve))
    coordinates, rates, h = np.array([0.4, 0.03, -0.02]), np.array([0.8, -0.05, 0.3]), 1e-5
    _, v = target(coordinates, rates)
    ahead, behind = (target(coordinates + side * h * rates, rates)[0] for side in (1, -1))
    np.testing.assert_allclose(v, (ahead - behind) / (2.0 * h), atol=1e-7)
    out, _ = target(np.array([0.4, 0.03, 0.0]), rates)
    assert np.hypot(*out[:2]) == pytest.approx(RADIUS + 0.03, abs=1e-12)
