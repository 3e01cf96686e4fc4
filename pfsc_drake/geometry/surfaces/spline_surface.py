"""Tensor-product splines as surfaces."""

import numpy as np

from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve
from pfsc_drake.geometry.curves.spline import UniformKnots, interpolate_at
from pfsc_drake.geometry.surfaces.basis import PowerBasis
from pfsc_drake.geometry.surfaces.product import ProductSurface


def uniform_spline_surface(
    first: UniformKnots, second: UniformKnots, coefficients: np.ndarray
) -> ProductSurface:
    """Spline surface of given B-spline coefficients.

    Args:
        first: Knots of theta_1.
        second: Knots of theta_2, of the same degree.
        coefficients: [first.count, second.count, 3], m.

    Returns:
        Surface of class C^(degree - 1).
    """
    count_1, count_2, dimension = coefficients.shape
    along_1 = first.curve(coefficients.reshape(count_1, -1))
    along_2 = second.curve(_second_first(along_1, count_2, dimension))
    return _assemble(along_1, along_2, dimension)


def interpolated_surface(
    parameters: tuple[np.ndarray, np.ndarray],
    points: np.ndarray,
    degree: int,
    closed: tuple[bool, bool],
) -> ProductSurface:
    """Spline surface through a grid of points at given parameters.

    Args:
        parameters: theta_1 [n_1] and theta_2 [n_2] of rows and columns, strictly increasing; of
            a closed direction with the end of the period last.
        points: [n_1, n_2, 3], m; the last row or column of a closed direction is the first.
        degree: Degree of the polynomials; an open direction needs more points than that.
        closed: Which directions are periodic.

    Returns:
        Surface of class C^(degree - 1).
    """
    count_1, count_2, dimension = points.shape
    along_1 = interpolate_at(parameters[0], points.reshape(count_1, -1), degree, closed=closed[0])
    values = _second_first(along_1, count_2, dimension)
    along_2 = interpolate_at(parameters[1], values, degree, closed=closed[1])
    return _assemble(along_1, along_2, dimension)


def _second_first(curve: PiecewisePolynomialCurve, count: int, dimension: int) -> np.ndarray:
    """Polynomials of theta_1 as vectors that a spline of theta_2 takes on, [count, ...]."""
    pieces, terms, _ = curve.coefficients.shape
    table = curve.coefficients.reshape(pieces, terms, count, dimension)
    return np.moveaxis(table, 2, 0).reshape(count, -1)


def _assemble(
    first: PiecewisePolynomialCurve, second: PiecewisePolynomialCurve, dimension: int
) -> ProductSurface:
    """Surface from polynomials of theta_1, and of theta_2 with the former as values."""
    degree = first.degree
    table = second.coefficients.reshape(
        *second.coefficients.shape[:2], *first.coefficients.shape[:2], dimension
    ).transpose(2, 0, 3, 1, 4)
    basis_1, basis_2 = (
        PowerBasis(curve.breakpoints, degree, closed=curve.closed) for curve in (first, second)
    )
    return ProductSurface(basis_1, basis_2, table, smoothness=degree - 1)
