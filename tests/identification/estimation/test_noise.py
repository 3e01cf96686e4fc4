"""Covariance of estimates under noise whose covariance is known in closed form."""

from types import SimpleNamespace

import numpy as np
import pytest

from identification.estimation.least_squares import (
    coloured_covariance,
    mean_torque_spectrum,
)

JOINTS, SIZE = 2, 3


def system(samples, seed=0):
    """Return a linear system of some samples, of which some torques do not count."""
    random = np.random.default_rng(seed)
    matrix = random.normal(size=(samples, JOINTS, SIZE))
    used = random.uniform(size=(samples, JOINTS)) > 0.2
    return SimpleNamespace(matrix=matrix, used=used, variance=np.array([0.5, 2.0]))


def expected(system, covariances):
    """Return the covariance of weighted least squares, with matrices written out."""
    weight = system.used / system.variance
    X = [system.matrix[:, j] for j in range(JOINTS)]
    inverse = np.linalg.inv(sum(X[j].T @ (weight[:, j, None] * X[j]) for j in range(JOINTS)))
    G = [inverse @ (X[j] * weight[:, j, None]).T for j in range(JOINTS)]
    return inverse, sum(G[j] @ covariances[j] @ G[j].T for j in range(JOINTS))


def noise_of(kind, samples):
    """Return a covariance of one joint's noise, and the power of its spectrum."""
    k, power = np.arange(samples), np.zeros(samples // 2 + 1)
    if kind == "offset":  # another one in each period
        power[0] = 0.3 * samples
        return 0.3 * np.ones((samples, samples)), power
    if kind == "alternating":
        power[-1] = 0.3 * samples
        return 0.3 * (-1.0) ** (k[:, None] - k), power
    if kind == "wave":  # of any phase
        power[2] = 0.3 * samples / 4.0
        return 0.15 * np.cos(2.0 * np.pi * 2 * (k[:, None] - k) / samples), power
    power[:] = 0.3
    return 0.3 * np.eye(samples), power


@pytest.mark.parametrize(
    ("kind", "samples"),
    [(kind, n) for kind in ("offset", "wave", "white") for n in (16, 17)] + [("alternating", 16)],
)
def test_covariance_under_noise_of_one_frequency(kind, samples):
    data = system(samples)
    noise, power = noise_of(kind, samples)
    white, flat = noise_of("white", samples)
    powers = np.column_stack([power, flat])
    inverse, covariance = expected(data, [noise, white])
    np.testing.assert_allclose(
        coloured_covariance(inverse, data, powers), covariance, rtol=1e-10, atol=1e-12
    )


def test_the_spectrum_is_that_of_the_mean():
    """White noise of P periods: its mean has the variance divided by P, at all frequencies."""
    periods = np.random.default_rng(1).normal(size=(5, 400, JOINTS)) * [1.0, 3.0]
    found = mean_torque_spectrum(SimpleNamespace(tau_periods=periods))
    powers, coloured = found
    assert not coloured.any()
    np.testing.assert_allclose(powers[7], np.array([1.0, 9.0]) / 5.0, rtol=0.1)
    # what all periods share is no noise
    shared = periods + 100.0 * np.sin(np.arange(400))[:, None]
    again = mean_torque_spectrum(SimpleNamespace(tau_periods=shared))
    np.testing.assert_allclose(again[0], powers, rtol=1e-9)


def test_an_offset_of_each_period_is_coloured_noise():
    """Its variance stands at frequency zero alone, smoothed over the neighbours."""
    random = np.random.default_rng(2)
    periods = 0.01 * random.normal(size=(6, 400, 1)) + random.normal(size=(6, 1, 1))
    found = mean_torque_spectrum(SimpleNamespace(tau_periods=periods))
    powers, coloured = found
    assert coloured.all()
    offsets = periods.mean(axis=1)[:, 0]
    power = 400 * np.var(offsets, ddof=1) / 6
    # by a window of 21 frequencies
    np.testing.assert_allclose(powers[0, 0], power / 21.0, rtol=0.05)
    assert powers[20, 0] < 1e-3 * powers[0, 0]
