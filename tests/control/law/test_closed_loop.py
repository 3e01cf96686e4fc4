"""The law on Drake's own plant: every virtual output obeys the linear dynamics of its poles.

The plant is Drake's multibody plant with motors, rotors and springs. The continuous controller
closes the loop, the differential equation is integrated tightly, and the result is compared with
``e^(r) + a_r e^(r-1) + ... + a_1 e = 0`` from the initial state on.
"""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import companion, expm
from scipy.spatial.transform import Rotation

from pfsc_drake.control.law.reference import rest_to_rest
from pfsc_drake.geometry import quaternion_to_matrix

STEP, STEPS = 5e-3, 100
# first derivative from nine equidistant values, error h^8 f^(9) / 630
NINE_POINTS = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])


class ClosedLoop:
    """A robot under a law: right-hand side, outputs and references."""

    def __init__(self, robot, path, law, theta):
        self.robot, self.path, self.law = robot, path, law
        self.r = law.linearization.relative_degree
        self.m, self.n = law.linearization.num_outputs, robot.n
        self._project = path.evaluator(self.r)
        # the whole comparison lies on one ramp, where the reference is a polynomial
        start = path.arc_length.at(theta) - 0.005
        ramp = rest_to_rest([start, start + 1.0], velocity=0.5, acceleration=1.6)
        assert ramp.breakpoints[1] > STEP * STEPS
        self._eta_p = ramp.flat_sampler(self.r)
        self._theta = theta
        # so many state variables are independent
        self.size = {1: self.n, 2: 2 * self.n}.get(self.r, 4 * self.n)

    def state(self, x):
        """Return ``[q_J, v_J, q_M, v_M]``."""
        x = np.concatenate([x, np.zeros(2 * self.n - len(x))]) if self.r == 1 else x
        return np.tile(x, 4 * self.n // len(x))

    def reference(self, t):
        """Return derivatives 0..r of the outputs' reference, one row each."""
        reference = np.zeros((self.r + 1, self.m))
        reference[:, 0] = self._eta_p(t)
        return reference

    def tau_ext(self, t):
        """Return external torques and derivatives 1..r-2."""
        amplitude, omega = 0.02 * self.robot.chain.gather("effort_limit"), 9.0
        orders = np.arange(max(self.r - 1, 0))[:, None]
        return amplitude * omega**orders * np.sin(omega * t + 0.3 + orders * np.pi / 2)

    def evaluate(self, t, x):
        """Return the law's result."""
        state = self.state(x)
        point = self._project(self.robot.tool_pose(state)[0].tolist(), self._theta)
        self._theta = point[0]
        return self.law.evaluate(
            state,
            point,
            self.reference(t).ravel(),
            np.zeros(self.m),
            tau_ext=self.tau_ext(t).ravel(),
        )

    def rates(self, t, x):
        """Return the right-hand side of the closed loop."""
        drive = self.evaluate(t, x)[self.law.layout.drive]
        if self.r == 1:
            return drive
        return self.robot.rates(self.state(x), drive, self.tau_ext(t)[0])[: self.size]


def start(robot, path, rigid, theta, size, seed=1):
    """Return a state beside the path, with an error in every output and velocity."""
    rng = np.random.default_rng(seed)
    n = robot.n
    sigma = path.position.derivatives(theta, 0)[0]
    R_e = None
    if path.orientation is not None:
        R_d = quaternion_to_matrix(path.orientation.derivatives(theta, 0)[0])
        R_e = R_d @ Rotation.from_euler("ZYX", [0.05, -0.04, 0.06]).as_matrix()
    q = robot.reach(sigma + np.array([0.006, -0.005, 0.008]), R_e)
    v, a, jerk = (scale * rng.uniform(-1.0, 1.0, n) for scale in (0.05, 1.0, 20.0))
    if size <= 2 * n:
        return np.concatenate([q, v])[:size]
    D_E, n_E = rigid.link_dynamics(q, v)
    K_s = robot.chain.K_s
    return np.concatenate([q, v, q + (D_E @ a + n_E) / K_s, v + D_E @ jerk / K_s])


def simulate(loop, x):
    """Return times and states on a grid, each of them a step's end, not interpolated."""
    times, states = STEP * np.arange(STEPS + 1), [x]
    for begin, end in pairwise(times):
        leg = solve_ivp(
            loop.rates, (begin, end), states[-1], method="DOP853", rtol=1e-11, atol=1e-12
        )
        states.append(leg.y[:, -1])
    return times, np.array(states)


# law, model, joint damping as a fraction of the stiffness [s], orientation, damping of the drives
CASES = {
    "velocity servos": ("velocity_servo", "comau_racer_1_4", 0.0, True, 0.0),
    "rigid": ("rigid", "comau_racer_1_4", 0.0, True, 0.0),
    "visco-elastic": ("visco_elastic", "comau_racer_1_4_elastic", 5e-3, True, 0.0),
    "elastic": ("elastic", "comau_racer_1_4_elastic", 0.0, True, 0.0),
    "elastic, three axes": ("elastic", "comau_racer_1_4_elastic_3r", 0.0, False, 0.0),
    "visco-elastic, three axes": ("visco_elastic", "comau_racer_1_4_elastic_3r", 2e-3, False, 0.0),
    "rigid, damped drives": ("rigid", "comau_racer_1_4", 0.0, True, 20.0),
    "elastic, damped drives": ("elastic", "comau_racer_1_4_elastic_3r", 0.0, False, 30.0),
    "visco-elastic, damped drives": (
        "visco_elastic",
        "comau_racer_1_4_elastic_3r",
        2e-3,
        False,
        30.0,
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_outputs_obey_the_predicted_linear_dynamics(
    case, load_robot, make_law, virtual_output, oriented_path, position_path
):
    name, model, damping, oriented, viscous = CASES[case]
    robot = load_robot(model)
    rigid = load_robot(model.replace("_elastic", ""))
    if damping or viscous:
        joints = tuple(damping * robot.chain.K_s) if damping else ()
        drives = tuple(viscous / (1.0 + i) for i in range(robot.n)) if viscous else ()
        robot = load_robot(model, joints, drives)
        assert np.array_equal(robot.chain.viscous_damping, drives or np.zeros(robot.n))
    if damping:
        assert np.allclose(robot.chain.K_d, damping * robot.chain.K_s, rtol=1e-12)
    path = oriented_path if oriented else position_path
    theta = 0.7
    law = make_law(robot.chain, name, oriented)
    loop = ClosedLoop(robot, path, law, theta)
    times, states = simulate(loop, start(robot, path, rigid, theta, loop.size))

    results = [loop.evaluate(t, x) for t, x in zip(times, states, strict=True)]
    assert not any(result[law.layout.status][0] for result in results)
    Y = np.array([result[law.layout.manifold_state] for result in results])
    Y = Y.reshape(len(times), loop.r, loop.m)
    v = np.array([result[law.layout.virtual_input] for result in results])
    reference = np.array([loop.reference(t) for t in times])

    # the outputs are what they are called, and every order is the derivative of the one below
    poses = [robot.tool_pose(loop.state(x)) for x in states]
    outputs = np.array([virtual_output(path, *pose) for pose in poses])
    assert np.allclose(Y[:, 0], outputs, rtol=0, atol=1e-10)
    chain = np.concatenate([Y, v[:, None]], axis=1)
    for k in range(loop.r):
        numeric = np.array([np.correlate(y, NINE_POINTS, "valid") for y in chain[:, k].T]).T / STEP
        scale = np.abs(chain[:, k + 1]).max(axis=0)
        assert np.all(scale > 0.0)
        assert np.abs((numeric - chain[4:-4, k + 1]) / scale).max() < 2e-6, f"order {k + 1}"

    # the errors are there at first, the reference moves, and the loop is linear
    initial = Y[0] - reference[0, : loop.r]
    assert np.all(np.abs(initial) > 1e-4)
    assert np.ptp(reference[:, 0, 0]) > 0.05
    predicted = reference[:, 0].copy()
    for i in range(loop.m):
        poles = [-20.0 - 3.0 * i - 2.0 * k for k in range(loop.r)]
        # the state of the companion form is e^(r-1), ..., e
        transition, e = expm(companion(np.poly(poles)) * STEP), initial[::-1, i]
        for row in predicted:
            row[i] += e[-1]
            e = transition @ e
    deviation = np.abs(outputs - predicted).max(axis=0)
    # the integration leaves 1e-13
    assert deviation.max() < 1e-10
