"""The sampled observer, against the torques that moved Drake's plants."""

import math

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.estimation.momentum import (
    MomentumModel,
    MomentumObserver,
    drive_momentum,
    link_momentum,
)
from pfsc_drake.errors import InputError

PERIOD, RATE, COUNT = 1e-3, 300.0, 25
FRICTION, TAU_EXT = np.array([30.0, -50.0, 12.0]), np.array([-25.0, 40.0, 15.0])
DRIVES = np.array([120.0, -300.0, 80.0]) * np.linspace(1.0, 2.0, COUNT)[:, None]


def observe(observer, states, drives, known=None):
    """Return the estimates at all samples, shape (samples, values)."""
    torques = {} if known is None else {"known_torque": known}
    stepper = Stepper(observer, tuple(torques))
    return np.array(
        [
            stepper.step(joint_state=state, drive_torque=drive, **torques)["estimate"]
            for state, drive in zip(states, [*drives, drives[-1]], strict=True)
        ]
    )


@pytest.mark.parametrize("kind", ["rigid", "elastic", "mixed"])
@pytest.mark.parametrize("momentum", [drive_momentum, link_momentum])
def test_a_constant_torque_is_approached_at_the_rate(drake_arm, kind, momentum):
    """``1 - exp(-L t)`` of it at every sample; what the law does and what else acts is known."""
    arm = drake_arm(kind)
    states = arm.move(DRIVES, lambda _: FRICTION, lambda _: TAU_EXT, PERIOD)
    unknown, known = FRICTION, TAU_EXT
    if momentum is link_momentum:
        unknown, known = TAU_EXT, FRICTION
    observer = MomentumObserver(momentum(arm.chain), RATE, PERIOD)
    estimates = observe(observer, states, DRIVES, known)
    risen = 1.0 - np.exp(-RATE * PERIOD * np.arange(COUNT + 1))
    # forces that swing within an interval enter by their trapezoidal mean
    np.testing.assert_allclose(estimates, np.outer(risen, unknown), rtol=0, atol=0.7)


def test_forces_on_the_tool_are_not_taken_for_friction_of_elastic_joints(drake_arm):
    arm = drake_arm("elastic")
    model = drive_momentum(arm.chain)
    ends = []
    for push in (0.0, 1.0):
        states = arm.move(DRIVES, lambda _: FRICTION, lambda _, p=push: p * TAU_EXT, PERIOD)
        ends.append(observe(MomentumObserver(model, RATE, PERIOD), states, DRIVES)[-1])
    np.testing.assert_allclose(ends[1], ends[0], rtol=0, atol=0.2)


def test_derivatives_of_a_torque_that_grows(drake_arm):
    """Without lag but the half interval over which the mean is taken."""
    arm, slope = drake_arm("rigid"), 40.0 * TAU_EXT
    states = arm.move(DRIVES, lambda _: FRICTION, lambda t: slope * t, PERIOD)
    observer = MomentumObserver(link_momentum(arm.chain), 3000.0, PERIOD, 1)
    value, rate = observe(observer, states, DRIVES, FRICTION)[-1].reshape(2, 3)
    np.testing.assert_allclose(value, slope * (COUNT - 0.5) * PERIOD, rtol=0, atol=0.05)
    np.testing.assert_allclose(rate, slope, rtol=0, atol=15.0)


def test_a_lost_sample_leaves_the_estimate_alone(drake_arm):
    arm = drake_arm("elastic")
    states = arm.move(DRIVES, lambda _: FRICTION, lambda _: TAU_EXT, PERIOD)
    lost = states.copy()
    lost[11, 9] = math.nan
    observer = MomentumObserver(drive_momentum(arm.chain), RATE, PERIOD)
    estimates, spoiled = observe(observer, states, DRIVES), observe(observer, lost, DRIVES)
    assert np.array_equal(spoiled[:11], estimates[:11])
    assert math.isnan(spoiled[11, 0])
    assert np.array_equal(spoiled[12], estimates[10])
    risen = 1.0 - np.exp(-RATE * PERIOD * (COUNT - 2))
    np.testing.assert_allclose(spoiled[-1], risen * FRICTION, rtol=0, atol=0.7)


def test_wrong_numbers_are_refused(drake_arm):
    model = drive_momentum(drake_arm("rigid").chain)
    with pytest.raises(InputError, match="number of derivatives: 3"):
        MomentumObserver(model, RATE, PERIOD, 3)
    with pytest.raises(InputError, match="bandwidth = 0"):
        MomentumObserver(model, 0.0, PERIOD)


def test_torques_are_of_the_age_of_the_velocities():
    """A mass that nothing but its drive moves, measured by difference quotients: none is seen."""
    drives = 50.0 * np.sin(0.5 * np.arange(COUNT) ** 1.5)[:, None]
    mass, state = 2.0, ca.SX.sym("state", 4)
    model = MomentumModel(
        state, mass * state[1], ca.SX(1, 1), np.ones(1), np.zeros(1), 1.0
    ).with_delay(PERIOD / 2.0)
    q, v = [0.0], 0.0
    for drive in drives[:, 0]:
        q.append(q[-1] + v * PERIOD + drive / mass * PERIOD**2 / 2.0)
        v += drive / mass * PERIOD
    quotients = np.diff(q, prepend=0.0) / PERIOD
    states = np.column_stack([q, quotients, q, quotients])
    found = observe(MomentumObserver(model, RATE, PERIOD), states, drives)
    np.testing.assert_allclose(found, 0.0, atol=1e-9)
