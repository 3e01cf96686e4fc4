"""Lags that were put in are found."""

from dataclasses import replace

import numpy as np
import pytest

from identification.measurement.periods import average
from identification.measurement.record import Record
from identification.measurement.synchronization import (
    check_torque_lag,
    check_velocities,
    torque_lag,
)
from pfsc_drake.errors import InputError

PARAMETERS = np.array([3.0, 2.0, 5.0, 9.0])


def regressor(v, a):
    """Return the regressor of ``tau = 3 a + 2 v + [5, 9] sign(v)``, with a dependent column."""
    Y = np.zeros((*v.shape, 5))
    Y[..., 0], Y[..., 1] = a, v
    Y[:, 0, 2], Y[:, 1, 3] = np.sign(v).T
    Y[..., 4] = Y[..., 0] + 2.0 * Y[..., 1]
    return Y


def measured(series, robot, lag, noise=0.3):
    t = np.arange(4 * 2000) * 0.001
    _, v, a = series.motion(t - lag)
    tau = regressor(v, a)[..., :4] @ PARAMETERS
    tau = tau + noise * np.random.default_rng(4).normal(size=tau.shape)
    return average(Record(t, series.motion(t)[0], tau, robot.joint_names, series.period))


@pytest.mark.parametrize("lag", [0.0, 0.0123, -0.03, 0.004])
def test_a_lag_of_the_torques_is_found(series, robot, lag):
    motion = measured(series, robot, lag)
    found = torque_lag(motion, regressor(motion.v, motion.a))
    assert found.standard_deviation < 3e-4
    # steps of friction between two samples can be anywhere there
    assert abs(found.time - lag) < 4.0 * found.standard_deviation + 0.5 * 0.001


def test_a_lag_is_refused_with_its_size(series, robot):
    motion = measured(series, robot, 0.02)
    with pytest.raises(InputError, match=r"tau lags the motion by (19.\d|20|20.\d) ms .* 2 ms"):
        check_torque_lag(motion, regressor(motion.v, motion.a))
    motion = measured(series, robot, -0.02)
    with pytest.raises(InputError, match="tau leads the motion"):
        check_torque_lag(motion, regressor(motion.v, motion.a))


def test_a_small_lag_is_tolerated(series, robot):
    motion = measured(series, robot, 0.0015)
    lag = check_torque_lag(motion, regressor(motion.v, motion.a))
    assert lag.time == pytest.approx(0.0015, abs=1e-3)


def test_a_regressor_of_another_motion(series, robot):
    motion = measured(series, robot, 0.0)
    with pytest.raises(InputError, match=r"regressor of shape \(1999, 2, 5\)"):
        torque_lag(motion, regressor(motion.v, motion.a)[1:])


def test_velocities_of_the_positions(record, series):
    check_velocities(record)
    check_velocities(replace(record, v=series.motion(record.t)[1]))


@pytest.mark.parametrize(("lag", "word"), [(0.04, "lags"), (-0.025, "leads")])
def test_late_velocities(record, series, lag, word):
    v = series.motion(record.t - [lag])[1]
    message = f"v of swing {word} the derivative of q by {abs(lag) * 1e3:.3g} ms; allowed: 10 ms"
    with pytest.raises(InputError, match=message):
        check_velocities(replace(record, v=v))


def test_velocities_in_degrees_or_turned(record, series):
    v = series.motion(record.t)[1]
    with pytest.raises(InputError, match=r"v of swing is 57.\d+ times the derivative"):
        check_velocities(replace(record, v=np.rad2deg(v)))
    with pytest.raises(InputError, match=r"v of lift is -1 times|v of lift is -1.000"):
        check_velocities(replace(record, v=v * [1.0, -1.0]))


def test_a_joint_that_sticks_before_it_reverses_is_not_late(series, robot):
    """Its friction turns 12 ms after the velocity, while it is slow; all else is in time."""
    t = np.arange(4 * 2000) * 0.001
    _, v, a = series.motion(t)
    tau = regressor(v, a)[..., :4] @ PARAMETERS
    stuck = np.abs(v) < 0.1 * np.abs(v).max(axis=0)
    before = np.sign(series.motion(t - 0.012)[1])
    tau += np.where(stuck, 3.0 * PARAMETERS[2:] * (before - np.sign(v)), 0.0)
    tau += 0.1 * np.random.default_rng(4).normal(size=tau.shape)
    motion = average(Record(t, series.motion(t)[0], tau, robot.joint_names, series.period))
    lag = check_torque_lag(motion, regressor(motion.v, motion.a))
    assert abs(lag.time) < 4.0 * lag.standard_deviation + 0.0005
