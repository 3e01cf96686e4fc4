"""Penalized splines of two parameters."""

import math

import numpy as np
import pytest

from pfsc_drake.geometry.curves.penalized_spline import PenalizedSpline
from pfsc_drake.geometry.curves.spline import UniformKnots

RNG = np.random.default_rng(8)
KNOTS = UniformKnots(0.0, 0.3, 9, 6, False), UniformKnots(-0.1, 0.1, 7, 6, False)


def places(count=600):
    return np.stack([RNG.uniform(k.begin, k.end, count) for k in KNOTS], axis=1)


def wavy(theta):
    return np.sin(14.0 * theta[:, 0]) * np.cos(11.0 * theta[:, 1])


def cubic(theta):
    u, v = theta.T
    return 1.0 + 2.0 * u - v + 3.0 * u * v + u**2 - 4.0 * u**2 * v + 5.0 * v**3 - u**3


@pytest.mark.parametrize("exponent", [-6.0, 0.0, 6.0])
def test_what_costs_no_energy_is_reproduced_whatever_the_penalty(exponent):
    theta = places()
    spline = PenalizedSpline(theta, cubic(theta), *KNOTS)
    assert np.abs(spline.residuals(spline.fit(exponent))).max() < 1e-9


def test_the_penalty_is_the_energy_of_a_thin_plate():
    axes = [np.linspace(k.begin, k.end, 60) for k in KNOTS]

    def power(axis, exponent):
        basis = KNOTS[axis].basis(axes[axis]).toarray()
        return np.linalg.lstsq(basis, axes[axis] ** exponent)[0]

    differences = PenalizedSpline(places(), np.zeros(600), *KNOTS)._differences
    energies = [
        float(np.sum((differences @ np.outer(power(0, 4 - a), power(1, a)).ravel()) ** 2))
        for a in range(5)
    ]
    # (d^4 f / du^a dv^(4-a))^2 = (a! (4 - a)!)^2, counted binom(4, a) times
    expected = [
        math.comb(4, a) * (math.factorial(a) * math.factorial(4 - a)) ** 2 for a in range(5)
    ]
    cells = [(9 + 6 - (4 - a)) * (7 + 6 - a) for a in range(5)]
    scaled = np.array(energies) / cells
    np.testing.assert_allclose(scaled / scaled[0], np.array(expected) / expected[0], rtol=1e-9)


@pytest.mark.slow
def test_cross_validation_finds_the_noise_and_nearly_the_best_penalty():
    theta, noise = places(1200), 0.01
    spline = PenalizedSpline(theta, wavy(theta) + noise * RNG.normal(size=1200), *KNOTS)
    exponent, found = spline.best_predicting()
    np.testing.assert_allclose(found, noise, rtol=0.06)
    fresh = places(4000)
    truth = PenalizedSpline(fresh, wavy(fresh), *KNOTS)

    def error(exponent):
        return np.sqrt(np.mean(truth.residuals(spline.fit(exponent)) ** 2))

    assert error(exponent) < 1.15 * min(error(e) for e in np.arange(-8.0, 10.0))
    # its standard errors are those of the truth
    ratio = truth.residuals(spline.fit(exponent)) / (
        noise * spline.standard_errors(fresh, exponent)
    )
    assert 0.6 < np.sqrt(np.mean(ratio**2)) < 1.3


def test_weights_say_how_near_the_spline_comes():
    theta = places()
    values = wavy(theta) + 0.1 * RNG.normal(size=len(theta))
    spline = PenalizedSpline(theta, values, *KNOTS)
    before = np.abs(spline.residuals(spline.fit(2.0)))
    weights = np.ones(len(theta))
    weights[5] = 1e6
    spline.weigh(weights)
    assert np.abs(spline.residuals(spline.fit(2.0)))[5] < 0.01 * before[5]


def test_periodic_splines_reproduce_constants_and_fit_waves():
    turn = UniformKnots(0.0, 1.0, 12, 6, True)
    theta = np.stack([RNG.uniform(0.0, 1.0, 900), RNG.uniform(-0.1, 0.1, 900)], axis=1)
    values = np.stack([np.cos(2.0 * np.pi * theta[:, 0]), np.ones(900)], axis=1)
    spline = PenalizedSpline(theta, values, turn, KNOTS[1])
    assert np.abs(spline.residuals(spline.fit(-8.0))).max() < 1e-4
    assert np.abs(spline.residuals(spline.fit(8.0))[:, 1]).max() < 1e-7
