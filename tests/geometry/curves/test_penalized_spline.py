"""Penalized splines against a dense least squares problem of their own."""

import numpy as np
import pytest

from pfsc_drake.geometry.curves.penalized_spline import PenalizedSpline
from pfsc_drake.geometry.curves.spline import UniformKnots

RNG = np.random.default_rng(5)
THETA = np.sort(RNG.uniform(0.0, 2.0, 60))
POINTS = np.stack([np.sin(3.0 * THETA), THETA**2, np.cos(THETA)], axis=1) + 5.0
WEIGHTS = RNG.uniform(0.5, 3.0, 60)


def _spline(intervals: int, degree: int, closed: bool) -> PenalizedSpline:
    knots = UniformKnots(0.0, 2.0, intervals, degree, closed)
    return PenalizedSpline(THETA[:, None], POINTS, knots)


def _dense(spline: PenalizedSpline, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Values at the points and differences of coefficients, column by column."""
    units = np.eye(count)
    basis = np.stack([spline.at_points(unit[:, None])[:, 0] for unit in units], axis=1)
    order = spline.knots[0].degree // 2 + 1
    if spline.knots[0].closed:
        steps = units
        for _ in range(order):
            steps = np.roll(steps, -1, axis=0) - steps
        return basis, steps
    return basis, np.diff(units, order, axis=0)


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("degree", [3, 4, 6])
@pytest.mark.parametrize("roughness", [1e-3, 1e2])
def test_the_sum_of_squares_is_least(closed: bool, degree: int, roughness: float) -> None:
    spline = _spline(12, degree, closed)
    count = 12 if closed else 12 + degree
    basis, steps = _dense(spline, count)
    rows = [
        np.sqrt(WEIGHTS)[:, None] * basis,
        np.sqrt(roughness * len(POINTS) / 12) * steps,
    ]
    right = np.vstack([np.sqrt(WEIGHTS)[:, None] * POINTS, np.zeros((len(steps), 3))])
    expected = np.linalg.lstsq(np.vstack(rows), right, rcond=None)[0]
    spline.weigh(WEIGHTS)
    found = spline.fit(np.log10(roughness))
    np.testing.assert_allclose(basis @ found, basis @ expected, atol=1e-9)


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("degree", [3, 4, 6])
def test_the_curve_is_the_spline(closed: bool, degree: int) -> None:
    spline = _spline(20, degree, closed)
    coefficients = spline.fit(-3.0)
    curve = spline.knots[0].curve(coefficients)
    assert curve.closed == closed
    assert curve.domain == (0.0, 2.0)
    assert curve.smoothness == degree - 1
    values = curve.derivatives(THETA, 0)[:, 0]
    np.testing.assert_allclose(values, spline.at_points(coefficients), atol=1e-12)
    # the class it has by construction is there indeed
    inner = curve.breakpoints[1:-1]
    for order in range(degree):
        left = curve.derivatives(inner - 1e-12, order)[:, order]
        right = curve.derivatives(inner + 1e-12, order)[:, order]
        size = np.abs(curve.derivatives(THETA, order)[:, order]).max()
        np.testing.assert_allclose(left, right, atol=1e-7 * size)


def test_a_strong_penalty_leaves_a_polynomial_and_no_rounding_errors() -> None:
    """The differences of order m of a polynomial of degree m - 1 vanish: least squares."""
    spline = _spline(30, 6, False)
    values = spline.at_points(spline.fit(10.0))
    fits = [np.polynomial.Polynomial.fit(THETA, column, 3) for column in POINTS.T]
    expected = np.stack([fit(THETA) for fit in fits], axis=1)
    np.testing.assert_allclose(values, expected, atol=1e-4)
