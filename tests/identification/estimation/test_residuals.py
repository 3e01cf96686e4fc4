"""Tests of residuals on residuals made up for them."""

import numpy as np
import pytest
from scipy.stats import kstest

from identification.estimation.least_squares import estimate
from identification.estimation.residuals import excess, whiteness
from pfsc_drake.errors import InputError


@pytest.fixture(scope="module")
def result(comau, measure):
    return estimate(comau.regressor, comau.base, measure())


def test_whiteness_of_white_and_coloured_residuals():
    rng = np.random.default_rng(0)
    names = [f"j{i}" for i in range(200)]
    e = rng.normal(size=(800, 200))
    used = rng.uniform(size=e.shape) > 0.1
    white = whiteness(e, used, names)
    assert kstest(white.p_value, "uniform").pvalue > 0.01
    inside = np.abs(white.autocorrelation) < white.bound * 1.06  # for the gaps
    assert 0.93 < inside.mean() < 0.98
    coloured = e[1:] + 0.3 * e[:-1]
    assert not (whiteness(coloured, used[1:], names).p_value > 0.01).any()
    r = whiteness(coloured, used[1:], names).autocorrelation[0].mean()
    assert r == pytest.approx(0.3 / 1.09, abs=0.01)


def test_whiteness_needs_residuals(result):
    with pytest.raises(InputError, match="100 residuals of joint_1, delays to 50"):
        whiteness(result.residuals[:100], np.ones((100, 6), bool), result.joint_names, lags=50)


def test_nothing_but_noise(comau, measure):
    """White or coloured, in motions that parameters are estimated from."""
    values = []
    for seed in range(8):
        colour = 0.9 * (seed % 2)
        run = estimate(comau.regressor, comau.base, measure(seed, colour=colour))
        found = excess(run.residuals, run.system.used, run.motion, parameters=52)
        assert found.freedom == pytest.approx(2 * 100 - 52 / 6)  # to 10 Hz
        values.append(found.p_value)
    assert kstest(np.ravel(values), "uniform").pvalue > 0.001
    assert np.min(values) > 1e-4


def test_something_is_missing(comau, measure):
    """A spring in one joint; ringing at a high frequency in another one is none."""
    extra = np.zeros_like(comau.motion[0])
    extra[:, 1] = 15.0 * comau.motion[0][:, 1] ** 2
    extra[:, 4] = 0.7 * np.sin(2.0 * np.pi * 30.0 * np.arange(1000) * 0.01)
    run = estimate(comau.regressor, comau.base, measure(extra=extra))
    found = excess(run.residuals, run.system.used, run.motion, parameters=52)
    assert not found.p_value[1] > 1e-4
    assert (found.p_value[3:] > 1e-3).all()
    assert not whiteness(run.residuals, run.system.used, run.joint_names).p_value[4] > 0.01


def test_power_by_hand(comau, measure):
    """Residuals of one sine against the mean noise."""
    motion = measure()
    used = np.ones(motion.q.shape, dtype=bool)
    wave = np.sin(2.0 * np.pi * 3.0 * np.arange(1000) / 1000.0)[:, None] * np.ones(6)
    found = excess(wave, used, motion, highest_hz=1.0)
    # ten harmonics share the square mean of one; each has two degrees of freedom
    np.testing.assert_allclose(found.ratio, 1000.0 * 0.5 / 20.0 / motion.mean_torque_variance)


def test_bad_frequencies(comau, result):
    for highest in (0.05, 60.0):
        with pytest.raises(InputError, match=rf"{highest:g} Hz; must be from 0\.1 Hz to 50 Hz"):
            excess(result.residuals, result.system.used, result.motion, highest)
    with pytest.raises(InputError, match="52 parameters, 4 frequencies of 6 joints"):
        excess(result.residuals, result.system.used, result.motion, 0.4, parameters=52)


def test_the_statistic_of_ljung_and_box():
    """Few residuals, where ``n + 2`` for n matters; the formula in a loop."""
    n, lags = 40, 4
    e = np.random.default_rng(5).normal(size=(n, 1))
    found = whiteness(e, np.ones((n, 1), bool), ["joint"], lags)
    x = e[:, 0] - e.mean()
    r = [np.sum(x[h:] * x[:-h]) / np.sum(x**2) for h in range(1, lags + 1)]
    expected = sum(n * (n + 2) * r[h - 1] ** 2 / (n - h) for h in range(1, lags + 1))
    assert found.statistic[0] == pytest.approx(expected, rel=1e-12)
