"""Convolutions with derivatives of a B-spline against closed forms."""

import numpy as np
import pytest

from identification.elastic.signals import (
    TestFunction,
    long_run_covariance,
    mean_sign,
    white_noise,
)

STEP = 1e-3


@pytest.mark.parametrize("hertz", [1.0, 20.0, 60.0])
def test_derivatives_fall_on_the_test_function(hertz):
    """``phi'' * sin = -w^2 phi * sin``."""
    function = TestFunction.of_knots(3e-3, STEP)
    w, t = 2.0 * np.pi * hertz, np.arange(1000) * STEP
    smooth = function.derivative(np.sin(w * t))
    rate, turned = function.derivative(np.sin(w * t), 1), w * function.derivative(np.cos(w * t))
    np.testing.assert_allclose(rate, turned, atol=1e-6 * w)
    np.testing.assert_allclose(
        function.derivative(np.sin(w * t), 2), -(w**2) * smooth, atol=5e-5 * w**2
    )
    # the response of a B-spline is a power of a sinc
    middle = np.sin(w * t)[function.half : -function.half]
    np.testing.assert_allclose(smooth, np.sinc(3e-3 * hertz) ** 6 * middle, atol=1e-6)


def test_white_noise_on_a_smooth_signal():
    t = np.arange(20_000) * STEP
    noise = 3e-6 * np.random.default_rng(0).normal(size=t.size)
    found = white_noise(np.sin(2.0 * np.pi * 5.0 * t) + noise)
    assert found == pytest.approx(3e-6, rel=0.05)


def test_mean_sign_over_a_reversal():
    # v = 3 - t, in samples: the reversal is half a sample before the fourth
    v = 3.0 - np.array([0.5, 1.5, 2.5, 3.25, 4.5])
    np.testing.assert_allclose(mean_sign(v), [1.0, 1.0, 1.0, 1.0 / 3.0, -1.0, -1.0])
    np.testing.assert_array_equal(mean_sign(np.zeros(4)), np.zeros(5))


def test_covariance_of_a_sum_of_correlated_numbers():
    """An autoregressive process: the variance of the sum is ``K s^2 / (1 - c)^2``."""
    c, count = 0.8, 200_000
    e = np.random.default_rng(1).normal(size=count)
    x = np.empty(count)
    x[0] = e[0]
    for k in range(1, count):
        x[k] = c * x[k - 1] + e[k]
    found = long_run_covariance(np.column_stack([x, 2.0 * x]), 100)
    expected = count / (1.0 - c) ** 2 * np.array([[1.0, 2.0], [2.0, 4.0]])
    np.testing.assert_allclose(found, expected, rtol=0.15)
