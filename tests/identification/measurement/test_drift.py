"""A change of friction that is put into the torques is found, and none where there is none."""

from dataclasses import replace

import numpy as np
import pytest

from identification.measurement.periods import average, friction_trend
from identification.measurement.record import Record
from pfsc_drake.errors import InputError

PERIODS = 5
NOISE = np.array([2.0, 3.0])
COULOMB, VISCOUS = np.array([5.0, 9.0]), np.array([2.0, 2.0])


def measured(series, robot, growth, seed=0):
    """Friction that grows evenly over the whole record."""
    t = np.arange(PERIODS * 400) * 0.005
    q, v, a = series.motion(t)
    scale = 1.0 + growth * np.arange(t.size)[:, None] / t.size
    tau = 3.0 * a + scale * (COULOMB * np.sign(v) + VISCOUS * v)
    noise = NOISE * np.random.default_rng(seed).normal(size=q.shape)
    return average(Record(t, q, tau + noise, robot.joint_names, series.period), skip=0)


def test_five_percent_are_detected(series, robot):
    # of 5 Nm with 2 Nm of noise on 2,000 samples
    trend = friction_trend(measured(series, robot, 0.5))
    assert trend.changes.all()
    # between the middles of the first and the last period
    share = 0.5 * (PERIODS - 1) / PERIODS
    np.testing.assert_array_less(
        np.abs(trend.coulomb - share * COULOMB), 4.0 * trend.coulomb_deviation
    )
    np.testing.assert_array_less(
        np.abs(trend.viscous - share * VISCOUS), 4.0 * trend.viscous_deviation
    )


def test_deviations_are_those_of_many_runs(series, robot):
    trends = [friction_trend(measured(series, robot, 0.0, seed)) for seed in range(60)]
    assert not any(trend.changes.any() for trend in trends)
    for name in ("coulomb", "viscous"):
        stated = np.mean([getattr(trend, f"{name}_deviation") for trend in trends], axis=0)
        found = np.std([getattr(trend, name) for trend in trends], axis=0)
        np.testing.assert_allclose(found, stated, rtol=4.0 / np.sqrt(2.0 * 60))


def test_a_joint_that_stands_still(series, robot):
    motion = measured(series, robot, 0.0)
    still = replace(motion, v=motion.v * [1.0, 0.0])
    with pytest.raises(InputError, match="lift must move to and fro"):
        friction_trend(still)


def test_the_change_is_that_from_the_first_to_the_last_period(series, robot):
    """Without noise, and with friction that grows from period to period: its very size."""
    t = np.arange(PERIODS * 400) * 0.005
    q, v, a = series.motion(t)
    grown = 1.0 + 0.1 * np.repeat(np.arange(PERIODS), 400)[:, None]
    tau = 3.0 * a + grown * (COULOMB * np.sign(v) + VISCOUS * v)
    record = Record(t, q, tau, robot.joint_names, series.period)
    trend = friction_trend(average(record, skip=0))
    np.testing.assert_allclose(trend.coulomb, 0.1 * (PERIODS - 1) * COULOMB, rtol=1e-6)
    np.testing.assert_allclose(trend.viscous, 0.1 * (PERIODS - 1) * VISCOUS, rtol=1e-6)
