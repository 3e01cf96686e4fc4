"""Curves through points with prescribed derivatives."""

from math import factorial

import numpy as np

from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve


def hermite_curve(parameters: np.ndarray, derivatives: np.ndarray) -> PiecewisePolynomialCurve:
    """Return the curve of class C^k with prescribed derivatives 0..k at points.

    Each piece is the polynomial of degree 2k + 1 with these derivatives at both of its ends, and
    is independent of all other points.

    Args:
        parameters: Parameters of the points, increasing, shape (points,).
        derivatives: Derivatives 0..k there, shape (points, k + 1, dimension).
    """
    k = derivatives.shape[1] - 1
    step = np.diff(parameters)
    # Taylor coefficients of both ends on the unit interval
    powers = step[:, None] ** np.arange(k + 1) / [factorial(j) for j in range(k + 1)]
    begin, end = (part * powers[:, :, None] for part in (derivatives[:-1], derivatives[1:]))
    # contribution of the upper half of the coefficients at the end
    order = np.arange(k + 1)
    binomials = np.array([[_binomial(i, j) for i in range(2 * k + 2)] for j in order])
    missing = end - np.einsum("ji,sid->sjd", binomials[:, : k + 1], begin)
    # of determinant 1: its inverse is of whole numbers
    inverse = np.rint(np.linalg.inv(binomials[:, k + 1 :]))
    upper = np.einsum("ij,sjd->sid", inverse, missing)
    unit = np.concatenate([begin, upper], axis=1)
    coefficients = unit / step[:, None, None] ** np.arange(2 * k + 2)[:, None]
    return PiecewisePolynomialCurve(parameters, coefficients, closed=False, known_smoothness=k)


def _binomial(i: int, j: int) -> float:
    return factorial(i) / (factorial(j) * factorial(i - j)) if i >= j else 0.0
