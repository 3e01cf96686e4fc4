"""The law along a path that is carried by a moving frame, on Drake's own plant.

As the test along a path at rest: every output, measured in the frame, obeys the linear dynamics of
its poles for any motion of the frame. A law without the frame's highest derivative does not.
"""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.control.manifolds.moving_frame import POSE_SIZE, MovingFrameManifold
from pfsc_drake.control.manifolds.path import PathManifold
from tests.control.law.closed_loop import (
    ClosedLoop,
    assert_linear_dynamics,
    rest_of_state,
    simulate,
)

CASES = {
    "velocity_servo": ("comau_racer_1_4{}", True),
    "rigid": ("comau_racer_1_4{}", True),
    "visco_elastic": ("comau_racer_1_4{}_3r", False),
    "elastic": ("comau_racer_1_4{}_3r", False),
}
AXIS = np.array([0.3, -0.5, 0.8]) / np.linalg.norm([0.3, -0.5, 0.8])
ORIGIN = np.array([0.4, -0.1, 0.6])  # m
STEPS = 60  # in which the frame moves by centimetres


class Turntable:
    """A frame that swings about an oblique axis through a point that swings, too."""

    amplitude, omega = 0.1, 5.0  # rad, rad/s
    way, pace = np.array([0.02, -0.015, 0.02]), 6.0  # m, rad/s

    def rotation(self, t, k):
        """Return the k-th derivative of the rotation matrix, from its differential equation."""
        angle = [self._sine(self.amplitude, self.omega, t, i) for i in range(k + 1)]
        K = np.array([[0, -AXIS[2], AXIS[1]], [AXIS[2], 0, -AXIS[0]], [-AXIS[1], AXIS[0], 0]])
        derivatives = [Rotation.from_rotvec(angle[0] * AXIS).as_matrix()]
        for n in range(k):  # R' = angle' K R, by Leibniz
            terms = [math.comb(n, i) * angle[i + 1] * K @ derivatives[n - i] for i in range(n + 1)]
            derivatives.append(sum(terms))
        return derivatives[k]

    def position(self, t, k):
        """Return the k-th derivative of the origin [m]."""
        moving = self.way * self._sine(1.0, self.pace, t + 0.2, k)
        turning = [self.rotation(t, i) @ ORIGIN for i in range(k + 1)]
        return moving + (ORIGIN if k == 0 else 0.0) - turning[k]

    def jet(self, t, order):
        """Return the frame jet of an order."""
        rows = [np.append(self.position(t, k), self.rotation(t, k)) for k in range(order + 1)]
        return np.concatenate(rows)

    @staticmethod
    def _sine(amplitude, omega, t, k):
        return amplitude * omega**k * np.sin(omega * t + 0.4 + k * np.pi / 2)


class CarriedLoop(ClosedLoop):
    """A robot under a law along a path in a frame that moves."""

    frame, untold = Turntable(), 0

    def seen(self, t, x):
        """Return the tool in the frame."""
        y, R_e = self.robot.tool_pose(self.state(x))
        R = self.frame.rotation(t, 0)
        return R.T @ (y - self.frame.position(t, 0)), R.T @ R_e

    def evaluate(self, t, x):
        """Return the law's result."""
        place = self._project(self.seen(t, x)[0].tolist(), self._theta)
        self._theta = place[0]
        frame = self.frame.jet(t, self.r)
        if self.untold:
            frame[-POSE_SIZE * self.untold :] = 0.0
        return self.result(t, x, np.concatenate([place, frame]))


def begun(name, load_robot, make_law, path):
    """Return a loop, and its state at the start."""
    model, oriented = CASES[name]
    rigid = load_robot(model.format(""))
    robot = load_robot(model.format("_elastic")) if RELATIVE_DEGREE[name] > 2 else rigid
    if name == "visco_elastic":
        robot = load_robot(model.format("_elastic"), tuple(2e-3 * robot.chain.K_s))
    own = PathManifold(RELATIVE_DEGREE[name], oriented=oriented)
    law = make_law(robot.chain, name, manifold=MovingFrameManifold(own))
    loop = CarriedLoop(robot, path, law, theta=0.7)
    p, R = loop.frame.position(0.0, 0), loop.frame.rotation(0.0, 0)
    sigma = path.position.derivatives(0.7, 0)[0] + np.array([0.006, -0.005, 0.008])
    R_e = None
    if oriented:
        off = Rotation.from_euler("ZYX", [0.05, -0.04, 0.06]).as_matrix()
        R_e = R @ path.orientation.rotation_matrix(0.7) @ off
    q = robot.reach(p + R @ sigma, R_e)
    return loop, rest_of_state(robot, rigid, q, loop.size)


def followed(loop, x, path, virtual_output):
    """Simulate a loop, and return what :func:`assert_linear_dynamics` compares."""
    times, states = simulate(loop, x, STEPS)
    results = [loop.evaluate(t, x) for t, x in zip(times, states, strict=True)]
    assert not any(result[loop.law.layout.status][0] for result in results)
    Y = np.array([result[loop.law.layout.manifold_state] for result in results])
    v = np.array([result[loop.law.layout.virtual_input] for result in results])
    moved = [loop.frame.position(t, 0) for t in times]
    assert np.ptp(moved, axis=0).max() > 0.03
    seen = [loop.seen(t, x) for t, x in zip(times, states, strict=True)]
    outputs = np.array([virtual_output(path, *pose) for pose in seen])
    reference = np.array([loop.reference(t) for t in times])
    return Y.reshape(len(times), loop.r, loop.m), v, outputs, reference


SLOW = {"visco_elastic": [pytest.mark.slow]}


@pytest.mark.slow(but="velocity_servo")
@pytest.mark.parametrize("name", [pytest.param(n, marks=SLOW.get(n, [])) for n in CASES])
def test_outputs_obey_the_predicted_linear_dynamics(
    name, load_robot, make_law, virtual_output, oriented_path, position_path
):
    path = oriented_path if CASES[name][1] else position_path
    loop, x = begun(name, load_robot, make_law, path)
    assert_linear_dynamics(*followed(loop, x, path, virtual_output))


@pytest.mark.slow
def test_without_the_highest_derivative_they_do_not(
    load_robot, make_law, virtual_output, oriented_path
):
    """So that the test above can fail: unmodelled derivatives disturb the loop."""
    loop, x = begun("rigid", load_robot, make_law, oriented_path)
    loop.untold = 1
    told = followed(loop, x, oriented_path, virtual_output)
    with pytest.raises(AssertionError):
        assert_linear_dynamics(*told)
