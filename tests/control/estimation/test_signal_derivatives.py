"""Derivatives of sampled signals, against the signals' own and against weighted least squares."""

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.control.estimation.filters import SignalDerivatives
from pfsc_drake.errors import InputError

PERIOD = 1e-3


def follow(estimator, samples):
    """Return the estimates at all samples, shape (samples, k + 1, N)."""
    samples = [ca.DM(sample) for sample in samples]
    state, estimates = estimator.start(samples[0]), []
    for sample in samples:
        estimates.append(estimator.estimate(state, sample))
        state = estimator.predict(estimates[-1])
    return np.array([x.full().reshape(-1, sample.numel()) for x in estimates])


@pytest.mark.slow(but="2")
@pytest.mark.parametrize("degree", [0, 1, 2])
def test_polynomials_of_its_degree_are_followed_without_lag(degree):
    t = PERIOD * np.arange(1000)
    polynomials = [np.poly1d(c[: degree + 1]) for c in ([3.0, -40.0, 500.0], [-2.0, 7.0, 11.0])]
    samples = np.array([p(t) for p in polynomials]).T
    estimates = follow(SignalDerivatives(degree, 60.0, PERIOD), samples)
    for order in range(degree + 1):
        truth = np.array([np.polyder(p, order)(t[-1]) for p in polynomials])
        assert np.allclose(estimates[-1, order], truth, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("degree", [0, 1, 2])
def test_is_the_polynomial_fitted_with_fading_weights(degree):
    rng, bandwidth, count = np.random.default_rng(3), 200.0, 400
    samples = rng.standard_normal((count, 1))
    estimates = follow(SignalDerivatives(degree, bandwidth, PERIOD), samples)
    age = PERIOD * np.arange(count)[::-1]
    # the start of the recursion has faded by exp(-80)
    weights = np.exp(-0.5 * bandwidth * age)
    fit = np.polynomial.polynomial.polyfit(-age, samples[:, 0], degree, w=weights)
    derivatives = [1.0, 1.0, 2.0][: degree + 1] * fit
    assert np.allclose(estimates[-1, :, 0], derivatives, rtol=1e-6)


@pytest.mark.parametrize("degree", [0, 1, 2])
def test_poles_are_where_the_bandwidth_says(degree):
    estimator = SignalDerivatives(degree, 90.0, PERIOD)
    correction = np.eye(degree + 1)
    correction[:, 0] -= estimator.gain
    polynomial = np.poly(estimator.transition @ correction)
    expected = np.poly(np.full(degree + 1, np.exp(-90.0 * PERIOD)))
    assert np.allclose(polynomial, expected, rtol=0, atol=1e-13)


def test_a_signal_at_rest_has_no_derivatives():
    estimates = follow(SignalDerivatives(2, 50.0, PERIOD), np.full((20, 3), 4.0))
    assert np.allclose(estimates[:, 0], 4.0, rtol=0, atol=1e-12)
    assert np.allclose(estimates[:, 1:], 0.0, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        ((3, 10.0, PERIOD), "number of derivatives: 3"),
        ((-1, 10.0, PERIOD), "number of derivatives: -1"),
        ((1, -5.0, PERIOD), "bandwidth = -5.0 rad/s"),
        ((1, np.nan, PERIOD), "bandwidth = nan rad/s"),
        ((1, 10.0, 0.0), "period of 0.0 s"),
    ],
)
def test_refused(arguments, part):
    with pytest.raises(InputError, match=part):
        SignalDerivatives(*arguments)
