"""Hand guiding along a path or a surface within the limits of the robot."""

from types import SimpleNamespace

import casadi as ca
import daqp
import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.compliance.impedance_filter import GuidedMotion
from pfsc_drake.control.compliance.impedance_parameters import (
    CoordinateImpedance,
    ImpedanceParameters,
    Profile,
)
from pfsc_drake.control.fixtures.fixture_parameters import RobotLimitParameters
from pfsc_drake.control.fixtures.robot_limits import RobotLimits, limit_kinds
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.control.manifolds.surface import SurfaceManifold
from tests.control.compliance.impedance_on_numbers import ImpedanceOnNumbers
from tests.control.conftest import Robot
from tests.control.fixtures.arm_robot import START

PERIOD, MODEL, MASS = 1e-3, "comau_racer_1_4", 3.0


@pytest.fixture(scope="module")
def robot():
    return Robot(MODEL)


class Guided:
    """The block along the first of three axes, which are its manifold's point."""

    def __init__(self, robot, count, **changes):
        inputs = RobotLimitParameters(**{"speed_share": 0.2, "singular_floor": 0.01} | changes)
        self.limits = RobotLimits(robot.chain, inputs, np.array(START[MODEL]), oriented=True)
        kind = PathManifold(1, oriented=True) if count == 1 else SurfaceManifold(1)
        manifold = SimpleNamespace(
            axes=lambda point: ca.reshape(point, 3, 3),
            layout=SimpleNamespace(size=9),
            coordinates=kind.coordinates,
        )
        self.block = GuidedMotion(self.limits, manifold, PERIOD)
        self._stepper = Stepper(self.block)

    def allowed(self, q, v, axes, desired):
        """Return the allowed speed, and the force of each kind of limit."""
        state = np.concatenate([q, v, q, v])
        inputs = {"joint_state": state, "manifold_point": axes.T.ravel()}
        inputs |= {"desired_speed": [*desired, MASS]}
        speed = self._stepper.step(**inputs)["allowed_speed"]
        return speed, self._stepper.step(**inputs)["limit_force"]


def any_axes(random):
    return np.linalg.qr(random.normal(size=(3, 3)))[0]


def joints(robot, q, axes, speed):
    """Return joint velocities of a tool that moves along axes and does not turn."""
    velocity = axes[:, : len(speed)] @ speed
    J = robot.jacobian(q)  # angular rows first
    return np.linalg.solve(J, np.concatenate([np.zeros(3), velocity]))


@pytest.mark.slow(but="2")
@pytest.mark.parametrize("count", [1, 2])
def test_the_motion_that_is_allowed_takes_a_joint_to_its_share(robot, count):
    """At any present speed of the tool; slower motions are unchanged."""
    axes = any_axes(np.random.default_rng(1))
    guided, q = Guided(robot, count), np.array(START[MODEL])
    speed = np.array([0.2, -0.1])[:count]
    v, share = joints(robot, q, axes, speed), 0.2 * robot.chain.gather("velocity_limit")
    assert np.all(np.abs(v) < share)
    same, forces = guided.allowed(q, v, axes, speed)
    np.testing.assert_array_equal(same, speed)
    assert not forces.any()
    desired = np.array([3.0, -2.0])[:count]
    allowed, forces = guided.allowed(q, v, axes, desired)
    ratio = np.abs(joints(robot, q, axes, allowed)) / share
    assert ratio.max() == pytest.approx(1.0, abs=1e-9)
    # each limit that holds is met, and no other is named
    named = {kind for kind, force in zip(guided.block.kinds, forces, strict=True) if force > 0.0}
    assert named == {f"speed_{j + 1}" for j in np.flatnonzero(ratio > 1.0 - 1e-9)}
    # the nearest one: what is missing is pushed by the limits that hold alone
    assert (desired - allowed) @ (allowed - 0.5 * speed) > 0.0


@pytest.mark.slow(but="2")
@pytest.mark.parametrize("count", [1, 2])
def test_the_motion_closest_to_the_desired_one_is_found_under_all_limits(robot, count):
    """Speeds, ends and singular postures, against a solver with all of them."""
    random, limited_by = np.random.default_rng(count), set()
    guided = Guided(robot, count, singular_floor=0.3, speed_share=0.3, end_margin=0.5, settling=0.3)
    low, high = robot.chain.gather("position_limits").T
    for _ in range(60):
        q = np.array(START[MODEL]) + random.uniform(-0.5, 0.5, 6)
        joint = random.integers(6)
        q[joint] = random.choice([low[joint] + 0.6, high[joint] - 0.6])
        axes, v = any_axes(random), random.uniform(-0.3, 0.3, 6)
        desired = random.normal(size=count)
        table = guided.limits.function(q, v).full()
        table = table[table[:, 0] >= 0.0]
        A, lower = table[:, 1:4] @ axes[:, :count], -table[:, 4]
        upper, kinds = np.full(len(A), 1e30), np.zeros(len(A), dtype=np.int32)
        expected, _, flag, info = daqp.solve(np.eye(count), -desired, A, upper, lower, kinds)
        assert flag == 1
        allowed, limit_forces = guided.allowed(q, v, axes, desired)
        np.testing.assert_allclose(allowed, expected, atol=1e-8)
        # a multiplier belongs to a row of A, which is shorter than a unit
        forces, pushes = dict.fromkeys(guided.block.kinds, 0.0), np.abs(info["lam"])
        for number, push, row in zip(table[:, 0], pushes, A, strict=True):
            forces[limit_kinds(6)[int(number)]] += MASS / PERIOD * push * np.linalg.norm(row)
        np.testing.assert_allclose(limit_forces, list(forces.values()), rtol=1e-6, atol=1e-4)
        limited_by |= {kind.split("_")[0] for kind, force in forces.items() if force > 0.0}
    assert limited_by == {"speed", "end", "singular"}


def test_a_limit_that_the_motion_does_not_change_does_not_hold_it(robot):
    """Joint 1 turns the tool across the plane of the others; a motion within leaves it at rest."""
    q = np.array(START[MODEL])
    q[[0, 3, 5]] = 0.0
    guided, v = Guided(robot, 1), np.zeros(6)
    v[0] = 50.0
    axes = np.eye(3)[:, [2, 0, 1]]
    allowed, forces = guided.allowed(q, v, axes, [0.01])
    np.testing.assert_array_equal(allowed, [0.01])
    assert not forces.any()


@pytest.mark.parametrize("spoiled", ["desired", "joint", "point"])
def test_what_is_no_number_is_left_to_others(robot, spoiled):
    q, axes, desired = np.array(START[MODEL]), np.eye(3), np.array([0.3])
    {"desired": desired, "joint": q, "point": axes[:, 0]}[spoiled][0] = np.nan
    allowed, forces = Guided(robot, 1).allowed(q, np.zeros(6), axes, desired)
    np.testing.assert_array_equal(allowed, desired)
    assert not forces.any()


def test_the_force_that_brings_a_speed_about_is_that_of_the_impedance():
    """Damped, sprung and free: with it the next update has the speed; rigid coordinates rest."""
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
