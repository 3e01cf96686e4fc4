"""Kinematics of the DELTA robot against the constraint (2.30) and motions known otherwise."""

import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pfsc_drake.errors import InputError
from pfsc_drake.jets import Jet
from pfsc_drake.robot.delta.delta_parameters import load_delta_parameters
from pfsc_drake.robot.delta.delta_robot import DeltaRobot
from pfsc_drake.robot.delta.kinematics import rod_independence

ROBOT = DeltaRobot(load_delta_parameters())
GEOMETRY = ROBOT.parameters.geometry
LOWER, UPPER = ROBOT.gather("position_limits").T

travel = st.tuples(*[st.floats(a, b) for a, b in zip(LOWER, UPPER, strict=True)]).map(np.array)


def rods(q, y):
    """Rods from Fig. 2.2: slide points B_i on the rails to the plate's points C_i."""
    result = []
    for i in range(3):
        angle = 2.0 * math.pi * i / 3.0
        outwards = np.array([math.cos(angle), math.sin(angle), 0.0])
        A, P = 0.416 * outwards, np.array([0.0, 0.0, 0.325])
        B = A + q[i] * (P - A) / np.linalg.norm(P - A)
        result.append(y + 0.06 * outwards - B)
    return np.array(result)


@given(travel)
def test_direct_kinematics_fulfils_the_constraint(q):
    y = ROBOT.tool_position(q)
    lengths = np.linalg.norm(rods(q, y), axis=1)
    assert np.allclose(lengths, 0.5, rtol=0, atol=1e-12)


@given(travel)
def test_the_tool_hangs_below_the_slides(q):
    """Of the two solutions the one on the far side of the slides' plane, seen from the base."""
    y = ROBOT.tool_position(q)
    assert np.all(rods(q, y)[:, 2] > 0.0)


@given(travel)
def test_inverse_kinematics_inverts_direct_kinematics(q):
    y = ROBOT.tool_position(q)
    if y[2] <= 0.325:
        with pytest.raises(InputError, match="y_z must be greater than h_P"):
            ROBOT.joint_coordinates(y)
    else:
        assert np.allclose(ROBOT.joint_coordinates(y), q, rtol=0, atol=1e-12)


@given(st.floats(0.0, 0.15), st.floats(0.0, 2 * math.pi), st.floats(0.46, 0.70))
def test_direct_kinematics_inverts_inverse_kinematics(radius, angle, y_z):
    y = np.array([radius * math.cos(angle), radius * math.sin(angle), y_z])
    q = ROBOT.joint_coordinates(y)
    assert np.all((q >= LOWER) & (q <= UPPER))
    assert np.allclose(ROBOT.tool_position(q), y, rtol=0, atol=1e-12)


def test_symmetric_configuration_by_pythagoras():
    """Equal slides: one rod in the plane through z_0 and its rail, a right-angled triangle."""
    q, along = 0.2, 0.2 / math.hypot(0.416, 0.325)
    horizontal = 0.416 - 0.06 - along * 0.416
    y_z = along * 0.325 + math.sqrt(0.5**2 - horizontal**2)
    assert np.allclose(ROBOT.tool_position(np.full(3, q)), [0.0, 0.0, y_z], rtol=0, atol=1e-14)


@given(travel)
def test_jacobian_is_the_slope_of_direct_kinematics(q):
    step = 1e-4
    columns = []
    for e in np.eye(3) * step:
        near = ROBOT.tool_position(q + e) - ROBOT.tool_position(q - e)
        far = ROBOT.tool_position(q + 2 * e) - ROBOT.tool_position(q - 2 * e)
        columns.append((8.0 * near - far) / (12.0 * step))
    J_D = ROBOT.jacobian_at(q)
    assert np.allclose(J_D, np.array(columns).T, rtol=1e-7, atol=1e-8)


@pytest.fixture(scope="module")
def tool_jet():
    """The jet of order 4 of the tool position as a function of numbers."""
    coefficients = ca.SX.sym("q", 3, 5)
    q = [Jet(ca.horzsplit(coefficients[i, :])) for i in range(3)]
    y_t, R_e = ROBOT.tool_pose(q)
    assert y_t.order == R_e.order == 4
    return ca.Function("jet", [coefficients], [ca.horzcat(*y_t.coefficients)])


@pytest.mark.slow
@settings(max_examples=25)
@given(travel, st.integers(0, 2**16))
def test_jet_is_the_taylor_series_along_a_polynomial_motion(tool_jet, q_0, seed):
    """Against CasADi's differentiation of the closed form, which the recursion does not use."""
    polynomial = np.random.default_rng(seed).uniform(-1.0, 1.0, (3, 5))
    polynomial[:, 0] = q_0
    t = ca.SX.sym("t")
    q = [sum(float(c) * t**k for k, c in enumerate(row)) for row in polynomial]
    y = ROBOT.tool_pose([Jet([q_i]) for q_i in q])[0].coefficients[0]
    expected = []
    for k in range(5):
        expected.append(np.array(ca.evalf(ca.substitute(y, t, 0.0))).ravel() / math.factorial(k))
        y = ca.jacobian(y, t)
    jet, expected = np.array(tool_jet(polynomial)), np.array(expected).T
    scale = np.max(np.abs(expected), axis=0)
    assert np.all(np.abs(jet - expected) < 1e-11 * np.maximum(1.0, scale))


def test_jet_extrapolates_the_motion(tool_jet):
    """Without any symbolic differentiation: the remainder is of the fifth order."""
    polynomial = np.array([[0.12, 0.4, -0.8, 0.5, 1.0], [0.2, -0.3, 0.6, 1.0, -2.0]])
    polynomial = np.vstack([polynomial, [0.16, 0.2, 0.3, -0.7, 0.9]])
    jet, errors = np.array(tool_jet(polynomial)), []
    for t in (0.08, 0.04):
        powers = t ** np.arange(5)
        errors.append(np.linalg.norm(jet @ powers - ROBOT.tool_position(polynomial @ powers)))
    assert errors[0] < 2e-4
    assert errors[0] / errors[1] == pytest.approx(2**5, rel=0.25)


def test_orientation_is_constant():
    q = [Jet.from_derivatives([ca.SX(0.1), ca.SX(1.0), ca.SX(-2.0)]) for _ in range(3)]
    _, R_e = ROBOT.tool_pose(q)
    values = [np.array(ca.evalf(c)) for c in R_e.coefficients]
    assert np.array_equal(values, [np.eye(3), np.zeros((3, 3)), np.zeros((3, 3))])


def test_the_travel_keeps_clear_of_singular_configurations():
    corners = np.array(np.meshgrid(*zip(LOWER, UPPER, strict=True))).reshape(3, -1).T
    least = ROBOT.parameters.workspace.min_rod_independence
    for q in corners:
        units = rods(q, ROBOT.tool_position(q)) / 0.5
        expected = math.sqrt(np.linalg.eigvalsh(units @ units.T)[0])
        independence = rod_independence(GEOMETRY, q, ROBOT.tool_position(q))
        assert independence == pytest.approx(expected, abs=1e-12)
        assert independence > least
    # all rods are vertical, thus parallel, where the slides are above the plate's points
    parallel = np.full(3, (0.416 - 0.06) / 0.416 * math.hypot(0.416, 0.325))
    assert rod_independence(GEOMETRY, parallel, np.array([0, 0, 0.78])) < 1e-2


@pytest.mark.parametrize(
    ("y_t", "message"),
    [
        ([0.0, 0.0, 1.2], "start: .* outside the workspace; rail 1 is .* m away"),
        ([0.0, 0.0, 0.76], r"slide \d would be at 0.42\d* m, its travel is 0 m to 0.4 m"),
        ([0.25, 0.0, 0.45], r"slide 1 would be at -0.\d+ m, its travel is 0 m to 0.4 m"),
        ([0.0, np.nan, 0.5], "must be 3 finite numbers"),
        ([0.0, 0.5], "must be 3 finite numbers"),
    ],
)
def test_points_outside_the_workspace_are_refused(y_t, message):
    with pytest.raises(InputError, match=message):
        ROBOT.joint_coordinates(np.array(y_t), "start")


def test_reach_message_tells_the_true_distance():
    """The distance of a point from the line of the rail, by another formula."""
    y_t = np.array([0.0, 0.0, 1.2])
    A, P = np.array([0.416, 0.0, 0.0]), np.array([0.0, 0.0, 0.325])
    C = y_t + np.array([0.06, 0.0, 0.0])
    distance = np.linalg.norm(np.cross(C - A, P - A)) / np.linalg.norm(P - A)
    with pytest.raises(InputError, match=f"is {distance:.6g} m away from"):
        ROBOT.joint_coordinates(y_t)


def test_nearly_parallel_rods_are_refused():
    """With longer rails' travel the singular configuration comes within reach."""
    parameters = load_delta_parameters()
    parameters.drives.position_upper = np.full(3, 0.5)
    with pytest.raises(InputError, match=r"nearly parallel .*; at least 0\.09 is allowed"):
        DeltaRobot(parameters).joint_coordinates(np.array([0.0, 0.0, 0.77]))
