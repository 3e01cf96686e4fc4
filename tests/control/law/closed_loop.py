"""A robot of Drake under a continuous law, integrated tightly, and what linear theory predicts."""

from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import companion, expm
from scipy.spatial.transform import Rotation

from pfsc_drake.control.law.reference import rest_to_rest
from pfsc_drake.geometry import quaternion_to_matrix

STEP, STEPS = 5e-3, 100
# of references that move all the time
FEW_STEPS = 40
# first derivative from nine equidistant values, error h^8 f^(9) / 630
NINE_POINTS = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])


class ClosedLoop:
    """A robot under a law: right-hand side, outputs and references."""

    def __init__(self, robot, path, law, theta):
        self.prepare(robot, law)
        self.path = path
        self._project = path.evaluator(self.r)
        # the whole comparison lies on one ramp, where the reference is a polynomial
        start = path.arc_length(theta) - 0.005
        ramp = rest_to_rest([start, start + 1.0], velocity=0.5, acceleration=1.6)
        assert ramp.breakpoints[1] > STEP * STEPS
        self._eta_p = lambda t: ramp.derivatives(t, self.r)[:, 0]
        self._theta = theta

    def prepare(self, robot, law):
        """Keep a robot and its law, whatever they follow."""
        self.robot, self.law = robot, law
        self.r = law.linearization.relative_degree
        self.m, self.n = law.linearization.num_outputs, robot.n
        self.middle = np.zeros(self.n)
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

    def posture(self, t):
        """Return derivatives 0..r of the posture reference of a robot with joints to spare."""
        if self.law.posture is None:
            return None
        omega, orders = 5.0, np.arange(self.r + 1)[:, None]
        swing = np.linspace(0.04, 0.08, self.n) * omega**orders
        swing = swing * np.sin(omega * t + np.arange(self.n) + orders * np.pi / 2)
        swing[0] += self.middle
        return swing

    def evaluate(self, t, x):
        """Return the law's result."""
        point = self._project(self.robot.tool_pose(self.state(x))[0].tolist(), self._theta)
        self._theta = point[0]
        return self.result(t, x, point)

    def result(self, t, x, point):
        """Return the law's result at a point of the manifold."""
        return self.law.evaluate(
            self.state(x),
            point,
            self.reference(t).ravel(),
            np.zeros(self.m),
            tau_ext=self.tau_ext(t).ravel(),
            posture=None if self.law.posture is None else self.posture(t).ravel(),
        )

    def rates(self, t, x):
        """Return the right-hand side of the closed loop."""
        return self.plant_rates(t, x, self.evaluate(t, x)[self.law.layout.drive])

    def plant_rates(self, t, x, drive):
        """Return the rates of the robot's state."""
        if self.r == 1:
            return drive
        return self.robot.rates(self.state(x), drive, self.tau_ext(t)[0])[: self.size]


def start(robot, path, rigid, theta, size, seed=1):
    """Return a state beside the path, with an error in every output and velocity."""
    n = robot.n
    sigma = path.position.derivatives(theta, 0)[0]
    R_e = None
    if path.orientation is not None:
        R_d = quaternion_to_matrix(path.orientation.derivatives(theta, 0)[0])
        # the wrist of the small arm is weak
        angles = (0.4 if n == 7 else 1.0) * np.array([0.05, -0.04, 0.06])
        R_e = R_d @ Rotation.from_euler("ZYX", angles).as_matrix()
    q = robot.reach(sigma + np.array([0.006, -0.005, 0.008]), R_e)
    return rest_of_state(robot, rigid, q, size, seed)


def rest_of_state(robot, rigid, q, size, seed=1):
    """Return a state of given joint coordinates, with random velocities, accelerations, jerks."""
    rng, n = np.random.default_rng(seed), robot.n
    v, a, jerk = (scale * rng.uniform(-1.0, 1.0, n) for scale in (0.05, 1.0, 20.0))
    if size <= 2 * n:
        return np.concatenate([q, v])[:size]
    D_E, n_E = rigid.link_dynamics(q, v)
    K_s = robot.chain.K_s
    return np.concatenate([q, v, q + (D_E @ a + n_E) / K_s, v + D_E @ jerk / K_s])


def simulate(loop, x, steps=STEPS):
    """Return times and states on a grid, each of them a step's end, not interpolated."""
    times, states, bold = STEP * np.arange(steps + 1), [x], STEP
    tight = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-12}
    for begin, end in pairwise(times):
        # what was accepted before spares steps that would be refused
        first = min(bold, end - begin)
        leg = solve_ivp(loop.rates, (begin, end), states[-1], first_step=first, **tight)
        states.append(leg.y[:, -1])
        bold = np.diff(leg.t).max()
    return times, np.array(states)


def predicted(initial, poles, steps=STEPS):
    """Return an error over the steps of :func:`simulate`, by its linear dynamics.

    Args:
        initial: The error and its derivatives at the start, shape (r,).
        poles: Of the dynamics, r of them.
        steps: How many steps.
    """
    # the state of the companion form is e^(r-1), ..., e
    transition, e = expm(companion(np.poly(poles)) * STEP), initial[::-1]
    errors = []
    for _ in range(steps + 1):
        errors.append(e[-1])
        e = transition @ e
    return np.array(errors)


def assert_linear_dynamics(Y, v, outputs, reference):
    """Check that outputs are what they are called, and obey the linear dynamics of their poles.

    Args:
        Y: Derivatives 0..r-1 that the law reports, shape (samples, r, m).
        v: Virtual inputs, shape (samples, m).
        outputs: By other means, shape (samples, m).
        reference: Derivatives 0..r, shape (samples, r + 1, m).
    """
    r, m = Y.shape[1:]
    assert np.allclose(Y[:, 0], outputs, rtol=0, atol=1e-10)
    # every order is the derivative of the one below
    chain = np.concatenate([Y, v[:, None]], axis=1)
    for k in range(r):
        numeric = np.array([np.correlate(y, NINE_POINTS, "valid") for y in chain[:, k].T]).T / STEP
        scale = np.abs(chain[:, k + 1]).max(axis=0)
        assert np.all(scale > 0.0)
        assert np.abs((numeric - chain[4:-4, k + 1]) / scale).max() < 2e-6, f"order {k + 1}"
    # the errors are there at first, and the loop is linear
    initial = Y[0] - reference[0, :r]
    assert np.all(np.abs(initial) > 1e-4)
    expected = reference[:, 0].copy()
    for i in range(m):
        poles = [-20.0 - 3.0 * i - 2.0 * k for k in range(r)]
        expected[:, i] += predicted(initial[:, i], poles, len(Y) - 1)
    # the integration leaves 1e-13
    assert np.abs(outputs - expected).max() < 1e-10
