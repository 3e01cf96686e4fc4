"""Points beside a path, from path coordinates."""

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import FourierCurve, Path, PiecewisePolynomialCurve
from pfsc_drake.geometry.paths.geometric_path import PathTarget
from pfsc_drake.physics.hand_model import HandModel, HandParameters, HandWaypoint
from tests.geometry.paths.newton_projector import Projector


@pytest.fixture(scope="module")
def path():
    return Path(FourierCurve.bent_lemniscate(), None)


@pytest.fixture(scope="module")
def target(path):
    return PathTarget(path)


@pytest.mark.parametrize("eta", [0.05, 0.7, 1.6])
def test_the_projection_gives_the_coordinates_back(path, target, eta):
    coordinates = np.array([eta, 0.012, -0.02])
    p, _ = target(coordinates, np.zeros(3))
    theta = path.arc_length.parameter(eta)
    projection = Projector(path.position).project(p.tolist(), theta + 0.01)
    assert projection.theta == pytest.approx(theta, abs=1e-9)
    sigma, slope = path.position.derivatives(theta, 1)
    assert np.linalg.norm(p - sigma) == pytest.approx(np.hypot(0.012, -0.02), rel=1e-9)
    assert (p - sigma) @ slope == pytest.approx(0.0, abs=1e-12)


def test_the_velocity_is_the_derivative_of_the_position(target):
    """Central differences along a motion of all three coordinates."""
    rates, h = np.array([0.8, -0.05, 0.3]), 1e-5
    for eta in (0.2, 0.9, 1.5):
        coordinates = np.array([eta, 0.03, -0.02])
        ahead, behind = (target(coordinates + side * h * rates, rates)[0] for side in (1, -1))
        _, v = target(coordinates, rates)
        np.testing.assert_allclose(v, (ahead - behind) / (2 * h), atol=1e-7)


def test_a_straight_path_ends_where_it_ends():
    line = PiecewisePolynomialCurve.line(np.zeros(3), np.array([0.0, 2.0, 0.0]))
    target = PathTarget(Path(line, None))
    p, v = target(np.array([0.5, 0.0, 0.0]), np.array([0.3, 0.0, 0.0]))
    np.testing.assert_allclose([p, v], [[0.0, 0.5, 0.0], [0.0, 0.3, 0.0]], atol=1e-12)
    p, _ = target(np.array([3.0, 0.0, 0.0]), np.zeros(3))
    np.testing.assert_allclose(p, [0.0, 2.0, 0.0], atol=1e-12)


def test_a_hand_on_the_path(path, target):
    parameters = HandParameters(
        waypoints=[HandWaypoint(0.0, [0.2, 0.0, 0.0]), HandWaypoint(1.0, [0.6, 0.02, 0.0])],
        frame="manifold",
    )
    model = HandModel(parameters, target)
    for time, coordinates in ((0.0, [0.2, 0.0, 0.0]), (0.5, [0.4, 0.01, 0.0])):
        p = ca.evalf(model.target(time)[0]).full().ravel()
        np.testing.assert_allclose(p, target(np.array(coordinates), np.zeros(3))[0], atol=1e-12)
    # halfway the profile of minimum jerk has 1.875 times the mean velocity
    v = ca.evalf(model.target(0.5)[1]).full().ravel()
    expected = target(np.array([0.4, 0.01, 0.0]), 1.875 * np.array([0.4, 0.02, 0.0]))[1]
    np.testing.assert_allclose(v, expected, atol=1e-12)


def test_wrong_frames():
    with pytest.raises(InputError, match="frame = tool; allowed: world, manifold"):
        HandParameters(frame="tool")
    with pytest.raises(InputError, match="frame = manifold; allowed: world without a path"):
        HandModel(HandParameters(frame="manifold"))
