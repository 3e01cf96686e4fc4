"""Piecewise polynomials against numpy.polynomial; measured smoothness."""

import math

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import PiecewisePolynomialCurve


def test_derivatives_agree_with_numpy_polynomials() -> None:
    rng = np.random.default_rng(1)
    for degree in (3, 7, 9):
        coefficients = rng.normal(size=(1, degree + 1, 2))
        curve = PiecewisePolynomialCurve([2.0, 3.5], coefficients)
        for axis in range(2):
            polynomial = np.polynomial.Polynomial(coefficients[0, :, axis])
            for theta in (2.0, 2.7, 3.5):
                expected = [polynomial.deriv(k)(theta - 2.0) for k in range(7)]
                np.testing.assert_allclose(
                    curve.derivatives(theta, 6)[:, axis], expected, 1e-12, 1e-12
                )


def test_segments_are_chosen_by_parameter() -> None:
    # |theta - 1| as two lines: right-continuous derivative at the corner.
    curve = PiecewisePolynomialCurve([0.0, 1.0, 3.0], [[[1.0], [-1.0]], [[0.0], [1.0]]])
    np.testing.assert_allclose(
        curve.derivatives([0.25, 1.0, 2.5], 1)[..., 0], [[0.75, -1], [0, 1], [1.5, 1]]
    )
    assert curve.smoothness == 0
    assert curve.first_discontinuity(0) is None
    assert curve.first_discontinuity(1) == 1.0


@pytest.mark.parametrize("lost", [1, 2, 3, 4, 5])
def test_smoothness_is_measured(lost: int) -> None:
    # Smooth quintic plus (theta - 2)_+^lost / lost!: the derivative of order `lost` jumps by one.
    base = np.polynomial.Polynomial([1.0, -0.5, 0.3, 0.2, -0.1, 0.05])
    breaks = [0.0, 1.0, 2.0, 3.0]
    coefficients = np.array(
        [[[base.deriv(k)(b) / math.factorial(k)] for k in range(6)] for b in breaks[:-1]]
    )
    assert PiecewisePolynomialCurve(breaks, coefficients).smoothness == math.inf
    coefficients[2, lost, 0] += 1.0 / math.factorial(lost)
    curve = PiecewisePolynomialCurve(breaks, coefficients)
    assert curve.smoothness == lost - 1
    assert curve.first_discontinuity(lost - 1) is None
    assert curve.first_discontinuity(lost) == 2.0


def test_tiny_jumps_count() -> None:
    curve = PiecewisePolynomialCurve([0, 1, 2], [[[0.0], [1.0]], [[1.0], [1.0 + 1e-6]]])
    assert curve.smoothness == 0
    rounding = PiecewisePolynomialCurve([0, 1, 2], [[[0.0], [1.0]], [[1.0], [1.0 + 1e-14]]])
    assert rounding.smoothness == math.inf


def test_seam_of_closed_curve_counts() -> None:
    parabola = [[[0.0], [1.0], [-1.0]]]  # u (1 - u)
    assert PiecewisePolynomialCurve([0, 1], parabola).smoothness == math.inf
    closed = PiecewisePolynomialCurve([0, 1], parabola, closed=True)
    assert closed.smoothness == 0
    assert closed.first_discontinuity(1) == 1.0


def test_line_is_parametrized_by_arc_length() -> None:
    line = PiecewisePolynomialCurve.line([1.0, 0.0, 2.0], [1.0, 3.0, 6.0])
    assert line.domain == (0.0, 5.0)
    assert line.smoothness == math.inf
    np.testing.assert_allclose(line.derivatives(2.5, 2), [[1, 1.5, 4], [0, 0.6, 0.8], [0, 0, 0]])


def test_between_rests_goes_through_its_points_and_rests_at_its_ends() -> None:
    theta = np.linspace(0.0, 2.0, 81)
    smooth = np.sin(np.pi * theta / 4.0) ** 4
    curve = PiecewisePolynomialCurve.between_rests(theta, np.column_stack([smooth, 2.0 * smooth]))
    assert np.abs(curve.derivatives(theta, 0)[:, 0, 0] - smooth).max() < 1e-13
    assert np.abs(curve.derivatives(curve.domain, 3)[:, 1:]).max() < 1e-8
    # sin^4 of x is 3/8 - cos(2 x) / 2 + cos(4 x) / 8
    at, w = 0.7313, np.pi / 4.0
    fourth = (4.0 * w) ** 4 * np.cos(4.0 * w * at) / 8.0 - (2.0 * w) ** 4 * np.cos(2.0 * w * at) / 2
    assert abs(curve.derivatives(at, 4)[4, 1] - 2.0 * fourth) < 1e-4
    assert curve.smoothness == 6


def test_errors() -> None:
    with pytest.raises(InputError, match=r"jump of position at theta = 1;"):
        PiecewisePolynomialCurve([0, 1, 2], [[[0.0], [1.0]], [[2.0], [1.0]]])
    with pytest.raises(InputError, match="2 segments; 2 breakpoints need 1"):
        PiecewisePolynomialCurve([0, 1], np.zeros((2, 2, 3)))
    with pytest.raises(InputError, match="shape"):
        PiecewisePolynomialCurve([0, 1], np.zeros((2, 3)))
    with pytest.raises(InputError, match="theta = 1"):
        PiecewisePolynomialCurve([0, 1, 2], [[[0.0], [1.0]], [[1.0], [math.nan]]])
    with pytest.raises(InputError, match="two different finite points"):
        PiecewisePolynomialCurve.line([1, 2, 3], [1, 2, 3])
