"""A hand that leads a tool along a path or a surface, as far as the robot can follow."""

from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.control.compliance.impedance import (
    CoordinateImpedance,
    ImpedanceParameters,
    Profile,
)
from pfsc_drake.control.compliance.led_motion import LedMotion
from pfsc_drake.control.fixtures.parameters import RobotLimitParameters
from pfsc_drake.control.fixtures.robot_limits import RobotLimits
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.control.manifolds.surface import SurfaceManifold
from tests.control.compliance.impedance_on_numbers import ImpedanceOnNumbers
from tests.control.conftest import Robot
from tests.control.fixtures.arm_robot import START

PERIOD, MODEL = 1e-3, "comau_racer_1_4"
NOWHERE = np.zeros(1)


@pytest.fixture(scope="module")
def robot():
    return Robot(MODEL)


def led(robot, axes, count, **changes):
    """Return the limits along the first axes, and joint velocities by Drake's Jacobian."""
    given = RobotLimitParameters(speed_share=0.2, singular_floor=0.01, **changes)
    limits = RobotLimits(robot.chain, given, np.array(START[MODEL]), oriented=True)
    kind = PathManifold(1, oriented=True) if count == 1 else SurfaceManifold(1)
    manifold = SimpleNamespace(
        axes=lambda point: ca.DM(axes), layout=SimpleNamespace(size=1), coordinates=kind.coordinates
    )
    return LedMotion(limits, manifold, PERIOD)


def joints(robot, q, axes, speed):
    """Return what joints move like if the tool moves along axes and does not turn."""
    velocity = axes[:, : len(speed)] @ speed
    J = robot.jacobian(q)  # angular rows first
    return np.linalg.solve(J, np.concatenate([np.zeros(3), velocity]))


@pytest.mark.parametrize("count", [1, 2])
def test_the_motion_that_is_allowed_takes_a_joint_to_its_share(robot, count):
    """However fast the tool moves now; and what is slower is left as it is."""
    axes = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    motion, q = led(robot, axes, count), np.array(START[MODEL])
    speed = np.array([0.2, -0.1])[:count]
    v, share = joints(robot, q, axes, speed), 0.2 * robot.chain.gather("velocity_limit")
    assert np.all(np.abs(v) < share)
    same, held = motion.allowed(q, v, NOWHERE, speed)
    np.testing.assert_array_equal(same, speed)
    assert not held.any()
    wanted = np.array([3.0, -2.0])[:count]
    allowed, held = motion.allowed(q, v, NOWHERE, wanted)
    ratio = np.abs(joints(robot, q, axes, allowed)) / share
    assert ratio.max() == pytest.approx(1.0, abs=1e-9)
    # each limit that holds is met, and no other is named
    named = {kind for kind, force in zip(motion.kinds, held, strict=True) if force > 0.0}
    assert named == {f"speed_{j + 1}" for j in np.flatnonzero(ratio > 1.0 - 1e-9)}
    # the nearest one: what is missing is pushed by the limits that hold alone
    assert (wanted - allowed) @ (allowed - 0.5 * speed) > 0.0


def test_a_motion_that_is_no_number_is_left_to_others(robot):
    motion = led(robot, np.eye(3), 1)
    allowed, held = motion.allowed(np.zeros(6), np.zeros(6), NOWHERE, np.array([np.nan]))
    assert np.isnan(allowed[0])
    assert not held.any()


def test_the_force_that_brings_a_speed_about_is_that_of_the_impedance():
    """Damped, sprung and free: with it the next update has the speed; what is rigid rests."""
    soft = CoordinateImpedance(Profile(2.0), Profile(30.0), Profile(500.0))
    free = CoordinateImpedance(Profile(5.0), Profile(60.0), Profile(0.0))
    coordinates = PathManifold(2, oriented=True).coordinates
    law = ImpedanceOnNumbers(ImpedanceParameters(free, soft), coordinates, 2, PERIOD)
    motion = np.zeros((2, 6))
    motion[:, :3] = [[0.1, 0.01, -0.02], [0.4, -0.1, 0.05]]
    state, desired, force = law.start(motion), np.zeros((3, 6)), np.arange(6.0)
    impedance = law.impedance(np.zeros(6))
    after, _ = law.update(state, desired, force, impedance)
    for along, speed in [(slice(0, 1), [0.1]), (slice(0, 3), [0.1, 0.2, -0.3])]:
        push = law.push_to(after, np.array(speed), force, along)
        np.testing.assert_array_equal(push[along.stop :], force[along.stop :])
        found, _ = law.update(state, desired, push, impedance)
        np.testing.assert_allclose(found[1, along], speed, rtol=1e-12)
    rigid = law.push_to(after, np.ones(3), force, slice(3, 6))
    np.testing.assert_array_equal(rigid, force)
