"""Momenta and their rates, against the accelerations of Drake's plants."""

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.control.estimation.momentum import drive_momentum, link_momentum
from pfsc_drake.robot.delta.delta_parameters import load_delta_parameters
from pfsc_drake.robot.delta.delta_robot import DeltaRobot

DRIVE = np.array([120.0, -300.0, 80.0])
FRICTION, TAU_EXT = np.array([30.0, -50.0, 12.0]), np.array([-25.0, 40.0, 15.0])


def derivative(function, state, rates, step=1e-5):
    """Return the derivative of a momentum along a motion, by central differences."""
    ends = [np.array(function(state + s * rates)[0]).ravel() for s in (step, -step)]
    return (ends[0] - ends[1]) / (2.0 * step)


@pytest.mark.parametrize("kind", ["rigid", "elastic", "mixed"])
@pytest.mark.parametrize("momentum", [drive_momentum, link_momentum])
def test_a_momentum_changes_by_what_acts_on_it(drake_arm, kind, momentum):
    arm = drake_arm(kind)
    model, state = momentum(arm.chain), arm.state()
    unknown, known = FRICTION, TAU_EXT
    if momentum is link_momentum:
        unknown, known = TAU_EXT, FRICTION
    rates = arm.rates(state, DRIVE, FRICTION, TAU_EXT)
    function = model.function
    forces = np.array(function(state)[1]).ravel()
    rate = forces + model.drive_weight * DRIVE + model.known_weight * known
    found = model.sign * (derivative(function, state, rates) - rate)
    np.testing.assert_allclose(found, unknown, rtol=0, atol=2e-4)


def test_friction_of_elastic_joints_depends_on_the_motors_alone(drake_arm):
    arm = drake_arm("elastic")
    model, state = drive_momentum(arm.chain), arm.state()
    assert not model.known_weight.any()
    momentum = np.array(model.function(state)[0]).ravel()
    np.testing.assert_allclose(momentum, arm.chain.D_M * state[9:], rtol=1e-14)
    assert not link_momentum(arm.chain).drive_weight.any()


def test_of_a_closed_chain():
    """The slides' momentum obeys the equations of motion of the DELTA robot."""
    robot = DeltaRobot(load_delta_parameters())
    q, v = np.array([0.2, 0.25, 0.15]), np.array([0.5, -0.8, 0.3])
    force, push = np.array([40.0, -20.0, 60.0]), np.array([10.0, -5.0, 8.0])
    acceleration = np.array(
        ca.DM(robot.acceleration(ca.SX(q), ca.SX(v), ca.SX(force), ca.SX(push)))
    ).ravel()
    model = drive_momentum(robot)
    state, rates = np.tile(np.concatenate([q, v]), 2), np.tile(np.append(v, acceleration), 2)
    function = model.function
    tau_ext = np.array(ca.DM(robot.jacobian(ca.SX(q)))).T @ push
    rate = np.array(function(state)[1]).ravel() + force + model.known_weight * tau_ext
    np.testing.assert_allclose(derivative(function, state, rates), rate, rtol=0, atol=1e-6)


@pytest.mark.parametrize("momentum", [drive_momentum, link_momentum])
def test_old_velocities_take_back_the_positions_of_links_and_motors(drake_arm, momentum):
    """The springs turn between the two ages, by ``delay (v_M - v_J)``."""
    arm, delay = drake_arm("elastic"), 2e-3
    model, state = momentum(arm.chain), arm.state()
    q_J, v_J, q_M, v_M = np.split(state, 4)
    assert np.abs(v_M - v_J).min() > 1e-3
    then = np.concatenate([q_J - delay * v_J, v_J, q_M - delay * v_M, v_M])
    expected = [np.array(part).ravel() for part in model.function(then)]
    late = model.with_delay(delay)
    found = [np.array(part).ravel() for part in late.function(state)]
    assert late.delay == delay
    np.testing.assert_allclose(found[0], expected[0], rtol=1e-13)
    np.testing.assert_allclose(found[1], expected[1], rtol=1e-11, atol=1e-9)
    if momentum is drive_momentum:
        now = np.array(model.function(state)[1]).ravel()
        springs = arm.chain.K_s * delay * (v_M - v_J)
        np.testing.assert_allclose(found[1] - now, springs, rtol=1e-9)
