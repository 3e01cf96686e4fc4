"""Curves through given derivatives, against polynomials and their own ends."""

from math import factorial

import numpy as np
import pytest

from pfsc_drake.geometry.curves.hermite import hermite_curve

PLACES = np.array([0.0, 0.3, 0.35, 1.1])


@pytest.mark.parametrize("order", [1, 2, 4])
def test_derivatives_at_both_ends_of_every_piece(order):
    given = np.random.default_rng(order).uniform(-1.0, 1.0, (4, order + 1, 2))
    curve = hermite_curve(PLACES, given)
    assert curve.degree == 2 * order + 1
    size = np.diff(PLACES).min() ** -np.arange(order + 1.0)[:, None]
    for ends in (PLACES, np.nextafter(PLACES, 0.0)[1:]):
        expected = given[-len(ends) :]
        assert np.abs((curve.derivatives(ends, order) - expected) / size).max() < 1e-10


@pytest.mark.parametrize("order", [2, 3])
def test_polynomials_are_their_own_curves(order):
    polynomial = np.polynomial.Polynomial(np.arange(1.0, 2 * order + 3))
    given = np.stack(
        [polynomial.deriv(k)(PLACES) if k else polynomial(PLACES) for k in range(order + 1)]
    )
    curve = hermite_curve(PLACES, given.T[:, :, None])
    between = np.linspace(0.0, 1.1, 50)
    values = curve.derivatives(between, order + 1)[:, :, 0]
    assert np.allclose(values[:, 0], polynomial(between), rtol=1e-12)
    assert np.allclose(values[:, -1], polynomial.deriv(order + 1)(between), rtol=1e-8)
    highest = curve.coefficients[:, -1, 0] * factorial(2 * order + 1)
    assert np.allclose(highest, polynomial.deriv(2 * order + 1)(0.0), rtol=1e-5)
