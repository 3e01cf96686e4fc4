"""Noise of estimated links against random samples; nominal friction."""

import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.estimation.link_deviation import StateUncertainty
from pfsc_drake.control.estimation.link_errors import (
    MotorEncoders,
    errors_of_measured_torques,
    errors_of_observed_torques,
    observing_network,
)
from pfsc_drake.control.estimation.momentum import MomentumObserver, motor_momentum
from pfsc_drake.control.estimation.robot_state import LinkState
from pfsc_drake.robot.robot_model import gravity_function

PERIOD, BANDWIDTH, COUNT, SETTLED = 1e-3, 800.0, 6000, 100
Q, NOTHING = np.array([0.3, 1.3, -0.5]), np.zeros(3)
STEP = np.full(3, 2.0 * np.pi / 2e5)
EXACT = MotorEncoders(NOTHING)


def at_rest(robot):
    """Return state and spring torques of a robot at rest."""
    weight = gravity_function(robot)(Q).full().ravel()
    bend = np.where(robot.elastic_joints, weight / robot.K_s, 0.0)
    return np.concatenate([Q, NOTHING, Q + bend, NOTHING]), weight


def measured_motors(rest, encoders, rng):
    """Return states whose motors are off by what steps of encoders are off, shape (COUNT, 12)."""
    off = (rng.random((COUNT, 3)) - 0.5) * encoders.step
    states = np.tile(rest, (COUNT, 1))
    states[:, 6:9] += off
    if encoders.difference_quotient:
        follow = 1.0 - np.exp(-PERIOD / encoders.filter_time) if encoders.filter_time else 1.0
        rate, before = np.zeros(3), np.zeros(3)
        for k in range(COUNT):
            rate = rate + follow * ((off[k] - before) / PERIOD - rate)
            states[k, 9:], before = rate, off[k]
    states[:, :6] = np.nan
    states[:, :3] = states[:, 6:9]
    states[:, 3:6] = states[:, 9:]
    return states


def spread(found):
    """Return standard deviations of positions and velocities, shape (2, 3)."""
    return found[SETTLED:].std(axis=0)[:6].reshape(2, 3)


ENCODERS = {
    "exact": EXACT,
    "steps": MotorEncoders(STEP),
    "differences": MotorEncoders(STEP, difference_quotient=True),
    "filtered": MotorEncoders(STEP, difference_quotient=True, filter_time=3e-3),
}


@pytest.mark.slow(but=["elastic-differences", "elastic-steps", "mixed-exact", "mixed-filtered"])
@pytest.mark.parametrize("encoders", ENCODERS)
@pytest.mark.parametrize("kind", ["elastic", "mixed"])
def test_noise_of_torques_and_steps_of_encoders(drake_arm, kind, encoders):
    robot, encoders = drake_arm(kind).chain, ENCODERS[encoders]
    noise = 0.002
    errors = errors_of_measured_torques(
        robot, StateUncertainty(torque_noise=noise), encoders, Q, BANDWIDTH, PERIOD
    )
    rng, (rest, weight) = np.random.default_rng(1), at_rest(robot)
    states = measured_motors(rest, encoders, rng)
    effort = np.where(robot.elastic_joints, robot.gather("effort_limit"), 0.0)
    torques = weight + noise * effort * rng.standard_normal((COUNT, 3))
    links = Stepper(LinkState(robot, BANDWIDTH, PERIOD))
    links.start(joint_state=rest, joint_torque=weight)
    found = np.array(
        [
            links.step(joint_state=x, joint_torque=tau)["joint_state"]
            for x, tau in zip(states, torques, strict=True)
        ]
    )
    np.testing.assert_allclose(errors.noise, spread(found), rtol=0.04, atol=1e-12)
    elastic = robot.elastic_joints
    assert np.all(errors.noise[:, elastic] > [[1e-6], [1e-4]])


@pytest.mark.slow(but=["differences", "steps"])
@pytest.mark.parametrize("encoders", ["steps", "differences", "filtered"])
def test_noise_of_what_motors_tell(drake_arm, encoders):
    robot, encoders = drake_arm("elastic").chain, ENCODERS[encoders]
    errors = errors_of_observed_torques(
        robot, StateUncertainty(), encoders, Q, BANDWIDTH, PERIOD, None
    )
    rest, weight = at_rest(robot)
    states = measured_motors(rest, encoders, np.random.default_rng(2))
    observer = Stepper(
        MomentumObserver(motor_momentum(robot, (NOTHING, NOTHING)), BANDWIDTH, PERIOD),
        ("known_torque",),
    )
    links, found = Stepper(LinkState(robot, BANDWIDTH, PERIOD)), []
    for state in states:
        torque = (
            weight
            + (
                observer.step(joint_state=state, drive_torque=weight, known_torque=weight)[
                    "estimate"
                ]
            )
        )
        found.append(links.step(joint_state=state, joint_torque=torque)["joint_state"])
    np.testing.assert_allclose(errors.noise, spread(np.array(found)), rtol=0.06, atol=1e-12)


def test_the_lag_is_that_of_a_ramp(drake_arm):
    """Growing drive torques on motors at rest are attributed to their springs."""
    robot = drake_arm("elastic").chain
    errors = errors_of_observed_torques(
        robot, StateUncertainty(), EXACT, Q, BANDWIDTH, PERIOD, None
    )
    rest, weight = at_rest(robot)
    finder = Stepper(observing_network(robot, BANDWIDTH, PERIOD))
    rate, count = np.array([400.0, -300.0, 200.0]), 60
    for k in range(count + 1):
        # over an interval drives hold the mean of what the springs' torque ramps through
        spring_torque = weight + rate * (k + 0.5) * PERIOD
        found = finder.step(joint_state=rest, drive_torque=spring_torque, known_torque=weight)
    q_J, v_J, q_M, _ = np.split(found["joint_state"], 4)
    observed = robot.K_s * (q_M - q_J) - robot.K_d * v_J
    late = (weight + rate * count * PERIOD - observed) / rate
    # what dampers bear is found by the velocity that was foretold
    np.testing.assert_allclose(late, errors.lag, rtol=0.01)


def test_exact_measurements_leave_no_noise(drake_arm):
    robot = drake_arm("elastic").chain
    sure = StateUncertainty(torque_noise=0.0)
    errors = errors_of_measured_torques(robot, sure, EXACT, Q, BANDWIDTH, PERIOD)
    assert not errors.noise.any()
    assert errors.has_torque_sensors
    assert errors.share == pytest.approx(np.hypot(sure.stiffness, sure.torque_scale))


def test_modelled_and_unmodelled_friction(drake_arm):
    robot, known = drake_arm("elastic").chain, StateUncertainty(friction=0.3, coulomb=0.04)
    f_c, f_v = np.array([10.0, 20.0, 5.0]), np.array([3.0, 4.0, 1.0])

    def errors(friction):
        return errors_of_observed_torques(robot, known, EXACT, Q, BANDWIDTH, PERIOD, friction)

    modelled, unmodelled = errors((f_c, f_v)), errors(None)
    np.testing.assert_allclose(modelled.coulomb, 0.3 * f_c)
    np.testing.assert_allclose(modelled.viscous, 0.3 * f_v)
    np.testing.assert_array_equal(modelled.stuck, f_c)
    np.testing.assert_allclose(unmodelled.coulomb, 0.04 * robot.gather("effort_limit"))
    np.testing.assert_array_equal(unmodelled.stuck, unmodelled.coulomb)
    assert not modelled.has_torque_sensors
