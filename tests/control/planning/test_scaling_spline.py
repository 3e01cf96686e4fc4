"""Speed scalings as splines, against integration and differences."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.interpolate import BSpline

from pfsc_drake.control.planning.scaling_spline import ScalingSpline, knots_of
from pfsc_drake.geometry import PiecewisePolynomialCurve

END, DEGREE = 1.3, 5
COEFFICIENTS = np.random.default_rng(1).uniform(0.6, 1.6, 12)


@pytest.fixture(name="scaling")
def fixture_scaling():
    return ScalingSpline(END, COEFFICIENTS, DEGREE)


def slow(theta):
    """Return the scaling from its definition."""
    return BSpline(knots_of(END, len(COEFFICIENTS) - DEGREE, DEGREE), COEFFICIENTS, DEGREE)(theta)


def test_times_are_the_integral_of_the_slowness(scaling):
    theta = np.linspace(0.0, END, 9)
    knots = np.linspace(0.0, END, 8)
    expected = []
    for end in theta:
        parts = pairwise([*knots[knots < end], end])
        expected.append(
            sum(quad(lambda x: 1.0 / slow(x), *part, epsabs=1e-14)[0] for part in parts)
        )
    assert np.allclose(scaling.times(theta), expected, rtol=0, atol=1e-10)
    assert scaling.duration == pytest.approx(expected[-1], abs=1e-10)


def test_rates_are_derivatives_by_time(scaling):
    theta = np.linspace(0.05, END - 0.05, 23)
    rates, h = scaling.rates(theta), 1e-5
    assert np.allclose(rates[:, 0], slow(theta), rtol=1e-13)
    for k in range(3):
        slope = (
            (scaling.rates(theta + h)[:, k] - scaling.rates(theta - h)[:, k])
            / (2.0 * h)
            * rates[:, 0]
        )
        assert np.allclose(rates[:, k + 1], slope, rtol=1e-6, atol=1e-6 * np.abs(slope).max())


def test_scaled_motion_is_the_motion_over_its_motion_time(scaling):
    """Against an integration of theta' = c(theta) without derivatives."""
    polynomial = np.array([0.1, 0.4, -0.3, 0.2, 0.5])
    motion = PiecewisePolynomialCurve([0.0, END], polynomial[None, :, None])
    moved = scaling.apply_to(motion, 4, 4e-3)
    times = np.linspace(0.0, scaling.duration, 40)
    options = {"t_eval": times, "rtol": 1e-12, "atol": 1e-13, "max_step": 2e-3}
    theta = solve_ivp(lambda _, x: slow(x), (0.0, times[-1]), [0.0], "DOP853", **options)
    expected = np.polynomial.Polynomial(polynomial)(theta.y[0])
    assert np.allclose(moved.derivatives(times, 0)[:, 0, 0], expected, rtol=0, atol=1e-10)
    assert moved.first_discontinuity(4) is None
    ends = moved.breakpoints[1:-1]
    before = moved.derivatives(np.nextafter(ends, 0.0), 4)
    scale = np.abs(before).max(axis=0)
    assert np.all(np.abs(before - moved.derivatives(ends, 4)) <= 1e-5 * scale)


def test_fit_to_values():
    """A cubic is reproduced; at jumps the fit stays above half of the least value."""
    values = 1.0 + 0.3 * np.linspace(-1.0, 1.0, 200) ** 3
    scaling = ScalingSpline.fit(END, values, 6, 4)
    theta = np.linspace(0.0, END, 50)
    expected = 1.0 + 0.3 * (2.0 * theta / END - 1.0) ** 3
    assert np.allclose(scaling.rates(theta)[:, 0], expected, rtol=0, atol=1e-10)
    jumping = ScalingSpline.fit(END, np.where(values > 1.0, 5.0, 0.1), 40, 4)
    assert jumping.rates(np.linspace(0.0, END, 500))[:, 0].min() >= 0.05
