"""Surfaces that are sums of products of functions of one parameter each, as splines are."""

import math

import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve
from pfsc_drake.geometry.curves.spline import UniformKnots, interpolate_at
from pfsc_drake.geometry.surfaces.basis import Basis, PowerBasis, curve_on_basis
from pfsc_drake.geometry.surfaces.parametric_surface import (
    Sampler,
    Surface,
    check_partial_order,
    partial_orders,
)
from pfsc_drake.geometry.surfaces.regularity import check_regular

# Samples that are evaluated together.
_CHUNK = 20_000
# Up to so many products of functions it is faster to multiply all of them first.
_FEW_PRODUCTS = 24


class ProductSurface(Surface):
    """sigma_t(theta) = sum_kl c_kl a_k(theta_1) b_l(theta_2), with other c_kl in each cell.

    Planes, surfaces of revolution, translated curves and tensor-product splines are of this
    kind. All partial derivatives at one point are one product of the cell's matrix with the
    products of the functions.

    Attributes:
        coefficients: The c_kl of all cells, as given.
        bases: Functions of either parameter.

    Args:
        first: Functions a_k of theta_1.
        second: Functions b_l of theta_2.
        coefficients: c_kl of each cell, [pieces_1, pieces_2, size_1, size_2, 3], m.
        smoothness: k of the class C^k.

    Raises:
        InputError: Wrong shape, or a coefficient that is not finite.
    """

    def __init__(
        self, first: Basis, second: Basis, coefficients: ArrayLike, *, smoothness: float
    ) -> None:
        super().__init__(
            (first.breakpoints, second.breakpoints),
            closed=(first.closed, second.closed),
            smoothness=smoothness,
        )
        table = np.array(coefficients, dtype=float)
        shape = (first.pieces, second.pieces, first.size, second.size, 3)
        if table.shape != shape:
            raise InputError(f"surface coefficients: shape {table.shape}; {shape} is required")
        if not np.all(np.isfinite(table)):
            raise InputError("surface coefficients: not finite; finite values are required")
        table.setflags(write=False)
        self.coefficients = table
        self.bases = (first, second)

    def partials(self, theta: ArrayLike, order: int) -> np.ndarray:
        """Return all partial derivatives up to a total order, for set-up and figures."""
        rows = np.array(partial_orders(check_partial_order(order)))
        values = self.to_domain(theta)
        flat = values.reshape(-1, 2)
        out = np.empty((len(flat), len(rows), 3))
        for begin in range(0, len(flat), _CHUNK):
            part = slice(begin, begin + _CHUNK)
            out[part] = self._partials(flat[part], order)[:, rows[:, 0], rows[:, 1]]
        return out.reshape(*values.shape[:-1], len(rows), 3)

    def _partials(self, theta: np.ndarray, order: int) -> np.ndarray:
        """Return derivatives up to an order in each direction, [n, order + 1, order + 1, 3]."""
        pieces, functions = [], []
        for k, basis in enumerate(self.bases):
            piece, values = basis.values(theta[:, k])
            pieces.append(piece)
            functions.append(np.einsum("ikl,nl->nik", basis.derivations(order), values))
        first, second = functions
        table = self.coefficients
        own = table[0] if table.shape[:2] == (1, 1) else table[pieces[0], pieces[1]]
        n, size_1, size_2 = len(theta), *table.shape[2:4]
        along = first @ own.reshape(-1, size_1, size_2 * 3)
        along = along.reshape(n, order + 1, size_2, 3).transpose(0, 2, 1, 3)
        both = second @ along.reshape(n, size_2, -1)
        return both.reshape(n, order + 1, order + 1, 3).transpose(0, 2, 1, 3)

    def flat_sampler(self, order: int) -> Sampler:
        """Return a fast scalar form of `partials` with a flattened result.

        The matrix of a cell is made when it is first entered.
        """
        first, second = (basis.sampler() for basis in self.bases)
        rows = partial_orders(check_partial_order(order))
        powers = [basis.derivations(order) for basis in self.bases]
        left = np.array([powers[0][i].T for i, _ in rows])[:, None]
        right = np.array([powers[1][j] for _, j in rows])[:, None]
        matrices: dict[tuple[int, int], np.ndarray] = {}
        size_1, size_2 = self.coefficients.shape[2:4]
        few = size_1 * size_2 <= _FEW_PRODUCTS
        shape = (3 * len(rows), -1) if few else (3 * len(rows) * size_1, size_2)

        def make(cell: tuple[int, int]) -> np.ndarray:
            table = left @ self.coefficients[cell].transpose(2, 0, 1) @ right
            matrices[cell] = table.reshape(shape)
            return matrices[cell]

        def sample_at_once(theta_1: float, theta_2: float) -> np.ndarray:
            p, a = first(theta_1)
            q, b = second(theta_2)
            matrix = matrices.get((p, q))
            if matrix is None:
                matrix = make((p, q))
            return matrix.dot([x * y for x in a for y in b])

        def sample_one_by_one(theta_1: float, theta_2: float) -> np.ndarray:
            p, a = first(theta_1)
            q, b = second(theta_2)
            matrix = matrices.get((p, q))
            if matrix is None:
                matrix = make((p, q))
            return matrix.dot(b).reshape(-1, size_1).dot(a)

        return sample_at_once if few else sample_one_by_one


def checked_product(surface: Surface) -> ProductSurface:
    """Return a surface that is a sum of products.

    Raises:
        InputError: It is not.
    """
    if not isinstance(surface, ProductSurface):
        raise InputError(f"surface: {type(surface).__name__}; a ProductSurface is required")
    return surface


def uniform_spline_surface(
    first: UniformKnots, second: UniformKnots, coefficients: np.ndarray
) -> ProductSurface:
    """Return the spline surface of B-spline coefficients.

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
    """Return a spline surface through a grid of points at prescribed parameters.

    Args:
        parameters: theta_1 [n_1] and theta_2 [n_2] of rows and columns, strictly increasing; of
            a closed direction with the end of the period last.
        points: [n_1, n_2, 3], m; the last row or column of a closed direction is the first.
        degree: Degree of the polynomials; an open direction needs more points than that.
        closed: Whether each direction is periodic.

    Returns:
        Surface of class C^(degree - 1).
    """
    count_1, count_2, dimension = points.shape
    along_1 = interpolate_at(parameters[0], points.reshape(count_1, -1), degree, closed=closed[0])
    values = _second_first(along_1, count_2, dimension)
    along_2 = interpolate_at(parameters[1], values, degree, closed=closed[1])
    return _assemble(along_1, along_2, dimension)


def _second_first(curve: PiecewisePolynomialCurve, count: int, dimension: int) -> np.ndarray:
    """Return polynomials of theta_1 as values of a spline of theta_2, [count, ...]."""
    pieces, terms, _ = curve.coefficients.shape
    table = curve.coefficients.reshape(pieces, terms, count, dimension)
    return np.moveaxis(table, 2, 0).reshape(count, -1)


def _assemble(
    first: PiecewisePolynomialCurve, second: PiecewisePolynomialCurve, dimension: int
) -> ProductSurface:
    """Return the surface of polynomials of theta_1, and of theta_2 with the former as values."""
    degree = first.degree
    table = second.coefficients.reshape(
        *second.coefficients.shape[:2], *first.coefficients.shape[:2], dimension
    ).transpose(2, 0, 3, 1, 4)
    basis_1, basis_2 = (
        PowerBasis(curve.breakpoints, degree, closed=curve.closed) for curve in (first, second)
    )
    return ProductSurface(basis_1, basis_2, table, smoothness=degree - 1)


def translated_surface(profile: Curve, rail: Curve) -> ProductSurface:
    """Return the surface swept by a profile along a rail without turning.

    sigma = profile(theta_1) + rail(theta_2).

    Args:
        profile: Curve in R^3, m.
        rail: Curve in R^3, m.

    Raises:
        InputError: A curve of another dimension, or a surface that is not regular.
    """
    for name, curve in (("profile", profile), ("rail", rail)):
        if curve.dimension != 3:
            raise InputError(f"{name}: dimension {curve.dimension}; 3 is required")
    first, moved = curve_on_basis(profile)
    second, moving = curve_on_basis(rail)
    coefficients = np.zeros((len(moved), len(moving), first.size, second.size, 3))
    coefficients[:, :, :, 0] += moved[:, None]
    coefficients[:, :, 0] += moving
    smoothness = min(profile.smoothness, rail.smoothness)
    surface = ProductSurface(first, second, coefficients, smoothness=smoothness)
    check_regular(surface)
    return surface


def extruded_surface(profile: Curve, direction: ArrayLike, length: float) -> ProductSurface:
    """Return the surface swept by a profile along a line; theta_2 is the distance, m.

    Args:
        profile: Curve in R^3, m.
        direction: Direction of the motion, of any length, [3].
        length: Length of the motion, m, positive.

    Raises:
        InputError: No direction or length, or one along the profile.
    """
    d = np.asarray(direction, dtype=float)
    norm = float(np.linalg.norm(d))
    if d.shape != (3,) or not 0.0 < norm < math.inf or not 0.0 < length < math.inf:
        raise InputError(
            f"extrusion: direction {d.tolist()}, length {length}; three finite numbers, not all"
            " zero, and a positive number of metres are required"
        )
    return translated_surface(
        profile, PiecewisePolynomialCurve.line(np.zeros(3), d * (length / norm))
    )
