"""Dynamics of the DELTA robot against Lagrange's equations."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pfsc_drake.jets import Jet
from pfsc_drake.robot.delta.delta_parameters import load_delta_parameters
from pfsc_drake.robot.delta.delta_robot import DeltaRobot
from pfsc_drake.robot.robot_model import gravity_function, gravity_torque

ROBOT = DeltaRobot(load_delta_parameters())
M_Q, M_Y, GRAVITY = 1.1, 1.85, 9.81
RAIL = np.hypot(0.416, 0.325)

travel = st.tuples(*[st.floats(0.0, 0.4)] * 3).map(np.array)
rates = st.tuples(*[st.floats(-2.0, 2.0)] * 3).map(np.array)


def jets_of(*derivatives):
    """One scalar jet per slide from q, q', q'', ..., each (3, 1)."""
    return [Jet.from_derivatives([d[i] for d in derivatives]) for i in range(3)]


@pytest.fixture(scope="module")
def ours():
    """(q, v, a) to torques, mass matrix, gravity."""
    q, v, a = (ca.SX.sym(name, 3) for name in "qva")
    tau = [t.coefficients[0] for t in ROBOT.inverse_dynamics(jets_of(q, v, a))]
    results = [ca.vertcat(*tau), ROBOT.mass_matrix(q), gravity_torque(ROBOT, q)]
    return ca.Function("ours", [q, v, a], results)


@pytest.fixture(scope="module")
def lagrange():
    """The same from T and V, (2.68) and (2.69), and the closed form y = h_D(q) alone."""
    q, v, a = (ca.SX.sym(name, 3) for name in "qva")
    y = ROBOT.tool_pose([Jet([q[i]]) for i in range(3)])[0].coefficients[0]
    y_rate = ca.jtimes(y, q, v)
    T = 0.5 * (M_Q * ca.dot(v, v) + M_Y * ca.dot(y_rate, y_rate))
    V = -(M_Y * y[2] + M_Q * 0.325 / RAIL * ca.sum1(q)) * GRAVITY
    momentum = ca.gradient(T, v)
    tau = ca.jtimes(momentum, q, v) + ca.jtimes(momentum, v, a) - ca.gradient(T - V, q)
    return ca.Function("lagrange", [q, v, a], [tau, ca.hessian(T, v)[0], ca.gradient(V, q)])


def close(a, b, tolerance=1e-10):
    a, b = np.array(a), np.array(b)
    return np.all(np.abs(a - b) <= tolerance * max(1.0, np.max(np.abs(b))))


@given(travel, rates, rates)
def test_inverse_dynamics_is_lagranges(ours, lagrange, q, v, a):
    for mine, expected in zip(ours(q, v, 10.0 * a), lagrange(q, v, 10.0 * a), strict=True):
        assert close(mine, expected)


@pytest.mark.slow
@given(travel, rates)
def test_mass_matrix_and_coriolis_matrix_are_consistent(ours, lagrange, q, v):
    """D is positive definite; v'(D' - 2 C)v = 0 although C v alone is known."""
    zero = np.zeros(3)
    bias, D, g = (np.array(x) for x in ours(q, v, zero))
    assert np.linalg.eigvalsh(D)[0] > M_Q * (1.0 - 1e-12)
    step = 1e-5
    D_rate = np.array(ours(q + step * v, v, zero)[1]) - np.array(ours(q - step * v, v, zero)[1])
    power = v @ (D_rate / (2.0 * step)) @ v - 2.0 * v @ (bias - g).ravel()
    assert abs(power) < 1e-5 * max(1.0, abs(2.0 * v @ (bias - g).ravel()))


@given(travel, rates)
def test_coriolis_matrix_of_2_72b_makes_a_skew_symmetric_matrix(ours, q, v):
    """C = m_y J' dJ/dt, with dJ/dt by differences of the Jacobian; D' - 2 C is skew-symmetric."""
    step = 1e-5
    J = ROBOT.jacobian_at(q)
    J_rate = (ROBOT.jacobian_at(q + step * v) - ROBOT.jacobian_at(q - step * v)) / (2.0 * step)
    C = M_Y * J.T @ J_rate
    bias, _, g = (np.array(x).ravel() for x in ours(q, v, np.zeros(3)))
    scale = max(1.0, np.max(np.abs(C)))
    assert np.allclose(C @ v, bias - g, rtol=0, atol=1e-5 * scale)
    zero = np.zeros(3)
    D_rate = np.array(ours(q + step * v, v, zero)[1]) - np.array(ours(q - step * v, v, zero)[1])
    N = D_rate / (2.0 * step) - 2.0 * C
    assert np.allclose(N, -N.T, rtol=0, atol=1e-5 * scale)


def test_holding_forces_by_virtual_work():
    """With all slides equal, 3 g_i dq lifts all masses."""
    q = np.full(3, 0.2)
    hold = np.array(gravity_function(ROBOT)(q)).ravel()
    sink = ROBOT.tool_position(q + 1e-6)[2] - ROBOT.tool_position(q - 1e-6)[2]
    work = -GRAVITY * (M_Y * sink / 2e-6 + 3.0 * M_Q * 0.325 / RAIL)
    assert np.allclose(hold, work / 3.0, rtol=0, atol=1e-7)
    assert np.all(hold < 0.0), "the drives hold the slides back from sinking"


def test_torque_jet_is_the_derivative_of_the_torque():
    """Orders 1 and 2 along a polynomial motion, against CasADi's differentiation in time."""
    t = ca.SX.sym("t")
    rows = np.random.default_rng(3).uniform(-1.0, 1.0, (3, 5))
    rows[:, 0] = [0.1, 0.25, 0.18]
    moving = ca.vertcat(*[sum(float(c) * t**k for k, c in enumerate(row)) for row in rows])
    derivatives = [moving]
    for _ in range(4):
        derivatives.append(ca.jacobian(derivatives[-1], t))
    at_start = [ca.substitute(d, t, 0.0) for d in derivatives]
    torque = ROBOT.inverse_dynamics(jets_of(*at_start))
    assert [tau.order for tau in torque] == [2, 2, 2]
    along = ca.vertcat(*[x.coefficients[0] for x in ROBOT.inverse_dynamics(jets_of(*derivatives))])
    for k in range(3):
        expected = ca.evalf(ca.substitute(along, t, 0.0))
        mine = ca.evalf(ca.vertcat(*[tau.derivative(k) for tau in torque]))
        assert close(mine, expected)
        along = ca.jacobian(along, t)


@pytest.mark.slow
@given(travel, rates, rates)
def test_acceleration_inverts_inverse_dynamics(ours, q, v, a):
    """Drive forces made of an acceleration and of an external force give that acceleration."""
    symbols = [ca.SX.sym(name, 3) for name in ("q", "v", "tau", "f")]
    acceleration = ca.Function("a", symbols, [ROBOT.acceleration(*symbols)])
    f_ext = np.array([3.0, -7.0, 20.0])
    force = np.array(ours(q, v, a)[0]).ravel() - ROBOT.jacobian_at(q).T @ f_ext
    assert np.allclose(np.array(acceleration(q, v, force, f_ext)).ravel(), a, rtol=0, atol=1e-9)


def test_what_laws_ask_of_a_robot():
    assert (ROBOT.dimension, ROBOT.is_elastic) == (3, False)
    assert list(ROBOT.names) == ["slide_1", "slide_2", "slide_3"]
    assert np.array_equal(ROBOT.D_M, np.zeros(3))
    assert np.array_equal(ROBOT.K_s, np.full(3, np.inf))
    assert np.array_equal(ROBOT.K_d, np.zeros(3))
    assert np.array_equal(ROBOT.gather("effort_limit"), np.full(3, 200.0))
    assert np.array_equal(ROBOT.gather("velocity_limit"), np.full(3, 3.0))
    assert np.array_equal(ROBOT.gather("position_limits"), [[0.0, 0.4]] * 3)
    with pytest.raises(AttributeError, match="'colour'; joints have name, kind"):
        ROBOT.gather("colour")
    ROBOT.gather("effort_limit")[0] = 1.0
    assert ROBOT.gather("effort_limit")[0] == 200.0
