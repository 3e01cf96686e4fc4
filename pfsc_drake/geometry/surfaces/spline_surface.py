"""Tensor-product splines as surfaces."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline
from scipy.sparse import csr_array

from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve
from pfsc_drake.geometry.curves.spline import interpolate_at, piecewise
from pfsc_drake.geometry.surfaces.basis import PowerBasis
from pfsc_drake.geometry.surfaces.product import ProductSurface


@dataclass(frozen=True)
class UniformKnots:
    """Equally spaced simple knots of a B-spline in one direction.

    Attributes:
        begin: Begin of the domain.
        end: End of the domain.
        intervals: Number of knot intervals.
        degree: Degree of the polynomials.
        closed: True for a periodic spline.
    """

    begin: float
    end: float
    intervals: int
    degree: int
    closed: bool

    @property
    def step(self) -> float:
        """Distance of neighbouring knots."""
        return (self.end - self.begin) / self.intervals

    @property
    def knots(self) -> np.ndarray:
        """All knots, those outside of the domain too, [intervals + 2 degree + 1]."""
        places = np.arange(-self.degree, self.intervals + self.degree + 1)
        return self.begin + self.step * places

    @property
    def count(self) -> int:
        """Number of distinct coefficients."""
        return self.intervals if self.closed else self.intervals + self.degree

    @property
    def linear(self) -> np.ndarray:
        """Coefficients of the function theta itself, of an open direction, [count]."""
        return self.begin + self.step * (np.arange(self.count) - (self.degree - 1) / 2.0)

    def entries(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Numbers and values of the B-splines not zero at parameters [n], [n, degree + 1] each."""
        knots = self.knots
        # Knots are multiples of a step: the ends are not exactly on them.
        inside = np.clip(theta, knots[self.degree], knots[-self.degree - 1])
        matrix = BSpline.design_matrix(inside, knots, self.degree)
        shape = (len(theta), self.degree + 1)
        return matrix.indices.reshape(shape) % self.count, matrix.data.reshape(shape)

    def basis(self, theta: np.ndarray) -> csr_array:
        """B-splines at parameters [n] within the domain, [n, count]."""
        columns, values = self.entries(theta)
        rows = np.broadcast_to(np.arange(len(theta))[:, None], columns.shape)
        place = (rows.ravel(), columns.ravel())
        return csr_array((values.ravel(), place), shape=(len(theta), self.count))

    def unfolded(self, coefficients: np.ndarray) -> np.ndarray:
        """Coefficients of all knots from the distinct ones, along the first axis."""
        return coefficients[np.arange(self.intervals + self.degree) % self.count]

    def curve(self, coefficients: np.ndarray) -> PiecewisePolynomialCurve:
        """The spline in this direction, [count, dimension], as a curve of polynomials."""
        knots = self.knots
        spline = BSpline(knots, self.unfolded(coefficients), self.degree)
        starts = knots[self.degree : -self.degree - 1]
        return piecewise(spline, starts, self.end, closed=self.closed)


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
