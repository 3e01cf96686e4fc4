"""Averages and derivatives against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from identification.excitation.fourier import FourierTrajectory
from identification.measurement.periods import average, differentiate
from identification.measurement.record import Record
from pfsc_drake.errors import InputError


@pytest.mark.parametrize("count", [400, 401])
def test_derivatives_of_a_series_are_exact(series, count):
    t = np.arange(count) * series.period / count
    signals = differentiate(series.motion(t)[0], series.period, 10.0)
    for found, expected in zip(signals, series.motion(t), strict=True):
        scale = np.abs(expected).max()
        np.testing.assert_allclose(found, expected, atol=1e-13 * count * scale)


def test_what_is_above_the_bandwidth_is_gone(series):
    t = np.arange(400) * 0.005
    clean = series.motion(t)[0]
    ripple = 0.01 * np.sin(2.0 * np.pi * 12.0 / series.period * t)[:, None]
    q, _, a = differentiate(clean + ripple, series.period, 11.0 / series.period)
    np.testing.assert_allclose(q, clean, atol=1e-13)
    np.testing.assert_allclose(a, series.motion(t)[2], atol=1e-9)
    filtered = differentiate(clean + ripple, series.period, 12.0 / series.period)[0]
    np.testing.assert_allclose(filtered, clean + ripple, atol=1e-13)


def test_the_first_period_and_the_rest_are_left_out(record):
    wrong = record.q.copy()
    wrong[:400] += 0.1
    longer = replace(record, q=wrong)
    motion = average(longer)
    assert motion.periods == 2
    np.testing.assert_allclose(motion.q, record.q[:400], atol=1e-12)
    np.testing.assert_allclose(motion.tau, record.tau[:400], atol=1e-12)
    cut = replace(record, t=record.t[:1150], q=record.q[:1150], tau=record.tau[:1150])
    assert average(cut, skip=0).periods == 2


def test_the_spread_tells_the_variance(series, robot):
    t = np.arange(6 * 400) * 0.005
    q = series.motion(t)[0]
    noise = np.random.default_rng(3).normal(size=(2, *q.shape)) * [[[1e-4, 2e-4]], [[3.0, 0.5]]]
    motion = average(Record(t, q + noise[0], 10.0 * q + noise[1], robot.joint_names, 2.0))
    # relative standard deviation of a variance with 4 x 400 degrees of freedom
    deviation = np.sqrt(2.0 / 1600.0)
    np.testing.assert_allclose(motion.torque_variance, [9.0, 0.25], rtol=4 * deviation)
    np.testing.assert_allclose(motion.position_variance, [1e-8, 4e-8], rtol=4 * deviation)
    error = motion.tau - 10.0 * q[:400]
    np.testing.assert_allclose(
        np.mean(error**2, axis=0), motion.mean_torque_variance, rtol=4 * np.sqrt(2.0 / 400.0)
    )


def refused(record, message, **options):
    with pytest.raises(InputError, match=message):
        average(record, **options)


def test_too_few_periods(record):
    refused(record, "6 s are 3 whole periods of 2 s; at least 2 beside the first 2", skip=2)
    refused(record, "6 s are 1 whole periods of 3.5 s", period=3.5, skip=0)


def test_a_period_must_be_known_and_a_multiple(record):
    refused(replace(record, period=None), "period of the motion is not known")
    refused(record, "period = 1.999 s is 399.8 sampling times of 0.005 s", period=1.999)
    refused(record, "period = -1", period=-1.0)


def test_a_wrong_period(record):
    refused(
        record, "q of swing differs from period to period by .* the period is not 1.5 s", period=1.5
    )


@pytest.mark.parametrize("bandwidth", [0.4, 100.0])
def test_bandwidth_out_of_range(record, bandwidth):
    refused(record, "must be from 0.5 Hz, the period's, to below 100 Hz", bandwidth_hz=bandwidth)


def test_a_gap_is_not_averaged_over(record):
    keep = np.delete(np.arange(record.t.size), slice(700, 710))
    refused(replace(record, t=record.t[keep], q=record.q[keep], tau=record.tau[keep]), "gap of")


def test_derivatives_of_noisy_positions(robot):
    """Derivatives of a Fourier excitation, with the errors of noise below the bandwidth.

    White noise of variance ``s^2`` has ``2 s^2 / (P K)`` in each harmonic of an average over P
    periods of K samples; a derivative multiplies it by ``w^2``.
    """
    rng = np.random.default_rng(5)
    motion = FourierTrajectory([0.2, 1.0], *rng.uniform(0.2, 1.0, (2, 2, 3)), 10.0, (1, 3, 5))
    t, noise = np.arange(50_000) * 1e-3, 1e-4
    clean = motion.motion(t)
    q = clean[0] + noise * rng.normal(size=(t.size, 2))
    tau = 3.0 * clean[2] + rng.normal(size=q.shape)
    averaged = average(Record(t, q, tau, robot.joint_names, motion.period))
    assert averaged.bandwidth_hz == 2.0 and averaged.periods == 4
    omega = 2.0 * np.pi * np.arange(1, 21) / motion.period
    for order, found in enumerate((averaged.q, averaged.v, averaged.a)):
        error = np.sqrt(np.mean((found - clean[order][:10_000]) ** 2, axis=0))
        expected = noise * np.sqrt(2.0 / (4 * 10_000) * np.sum(omega ** (2 * order)))
        np.testing.assert_allclose(error, expected, rtol=0.5)
        scale = np.abs(clean[order]).max(axis=0)
        assert np.all(error < 1e-4 * scale)
