"""Extension of a surface beyond the ends of its open directions, so that a tool may leave it."""

import math
from collections.abc import Callable

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.geometry.curves.polynomial import piece_function
from pfsc_drake.geometry.curves.run_out import RunOut, straightening_length
from pfsc_drake.geometry.surfaces.basis import Basis, TrigonometricBasis
from pfsc_drake.geometry.surfaces.parametric_surface import (
    Sampler,
    Surface,
    check_partial_order,
    partial_orders,
)
from pfsc_drake.geometry.surfaces.product import ProductSurface, checked_product

# Of the domain: length of the extension, and the longest transition to a straight line.
_REACH, _LONGEST = 0.25, 0.2
# Of the open part of a turn.
_OPEN_SHARE = 0.4
# Smallest area per parameters beyond the border, relative to the border's.
_AREA = 0.3
# Samples along a border, and from there outwards.
_SAMPLES, _STEPS = 9, 24


# theta, order -> derivatives 0..order, [order + 1, size]
Beyond = Callable[[ca.SX, int], ca.SX]


class ExtendedSurface(Surface):
    """Surface of class C^k on a larger domain.

    It reaches a quarter of the domain's length beyond each end; less where it would meet itself or
    get narrow, as before a pole or an apex. Circles are continued as circles. Other directions
    change to straight lines: each function of that parameter is continued by :class:`RunOut`, so
    that the surface remains a sum of products.

    Args:
        surface: The surface.
        smoothness: k.

    Attributes:
        inner: The surface.
    """

    def __init__(self, surface: ProductSurface, smoothness: int) -> None:
        self.inner = surface
        self._directions = [
            _Direction(surface, axis, basis, smoothness) for axis, basis in enumerate(surface.bases)
        ]
        for axis, direction in enumerate(self._directions):
            for side in (0, 1):
                direction.limits[side] = self._regular_up_to(axis, direction.limits[side])
        super().__init__(
            (self._directions[0].breakpoints, self._directions[1].breakpoints),
            closed=surface.closed,
            smoothness=min(surface.smoothness, smoothness),
        )

    def partials(self, theta: ArrayLike, order: int) -> np.ndarray:
        """Return all partial derivatives up to a total order, for set-up and figures."""
        values = self.to_domain(theta)
        sample = self.flat_sampler(order)
        flat = [sample(*pair) for pair in values.reshape(-1, 2).tolist()]
        return np.array(flat).reshape(*values.shape[:-1], -1, 3)

    def flat_sampler(self, order: int) -> Sampler:
        """Return a fast scalar form of `partials` with a flattened result.

        Within the surface's own domain it is the surface's sampler.
        """
        inside = self.inner.flat_sampler(check_partial_order(order))
        rows = np.array(partial_orders(order))
        first, second = self._directions
        table = self.inner.coefficients

        def sample(theta_1: float, theta_2: float) -> np.ndarray:
            if first.holds(theta_1) and second.holds(theta_2):
                return inside(theta_1, theta_2)
            p, along = first.derivatives(theta_1, order)
            q, across = second.derivatives(theta_2, order)
            every = np.einsum("ik,klc,jl->ijc", along, table[p, q], across)
            return every[rows[:, 0], rows[:, 1]].ravel()

        return sample

    @property
    def beyond(self) -> tuple[Beyond | None, Beyond | None]:
        """Functions of either parameter beyond its ends; None where they are continued as such."""
        first, second = (d.beyond if d.run_outs else None for d in self._directions)
        return first, second

    def _regular_up_to(self, axis: int, limit: float) -> float:
        """Return the last parameter towards a limit up to which the surface has enough area."""
        border = self.inner.domain[axis][limit > self.inner.domain[axis].begin]
        areas = self.flat_sampler(1)
        first, last = self._directions[1 - axis].limits
        across = np.linspace(first, last, _SAMPLES).tolist()
        least, reached = None, border
        for theta in np.linspace(border, limit, _STEPS + 1).tolist():
            points = [(theta, t) if axis == 0 else (t, theta) for t in across]
            tangents = np.array([areas(*point)[3:] for point in points]).reshape(-1, 2, 3)
            area = np.linalg.norm(np.cross(tangents[:, 0], tangents[:, 1]), axis=-1)
            least = _AREA * area if least is None else least
            if np.any(area < least):
                break
            reached = theta
        return reached


class _Direction:
    """The functions of one parameter, continued.

    Attributes:
        limits: First and last parameter of the larger domain.
        run_outs: Continuations of the functions before the begin and after the end; empty if they
            are continued as such.
    """

    def __init__(self, surface: ProductSurface, axis: int, basis: Basis, smoothness: int) -> None:
        self._basis, self._sample = basis, basis.sampler()
        begin, end = map(float, surface.domain[axis])
        self._begin, self._end = begin, end
        self._powers = basis.derivations(6)
        self.run_outs: list[RunOut] = []
        reach = 0.0 if basis.closed else _REACH * (end - begin)
        if isinstance(basis, TrigonometricBasis):
            reach = min(reach, _OPEN_SHARE * max(2.0 * math.pi - (end - begin), 0.0))
        elif not basis.closed:
            for theta, sign in ((begin, -1.0), (end, 1.0)):
                functions = self._own(theta, smoothness)[1]
                length = _straightening(surface, axis, theta, smoothness, _LONGEST * (end - begin))
                self.run_outs.append(RunOut(functions, functions[1], theta, sign * length))
        self.limits = [begin - reach, end + reach]

    @property
    def breakpoints(self) -> list[float]:
        """Ends of the pieces, those beyond the ends of the surface included."""
        first, last = self.limits
        inner = self._basis.breakpoints.tolist()
        return [*[first] * (first < inner[0]), *inner, *[last] * (last > inner[-1])]

    def holds(self, theta: float) -> bool:
        """Return whether a parameter is in the surface's own domain."""
        return self._basis.closed or self._begin <= theta <= self._end

    def derivatives(self, theta: float, order: int) -> tuple[int, np.ndarray]:
        """Return the piece and the functions with derivatives 0..order, [order + 1, size]."""
        if self.holds(theta) or not self.run_outs:
            return self._own(theta, order)
        last = bool(theta > self._end)
        run_out = self.run_outs[last]
        piece = self._basis.pieces - 1 if last else 0
        if not math.isfinite(theta):
            return piece, np.full((order + 1, run_out.dimension), math.nan)
        inside = min(max(theta, run_out.domain[0]), run_out.domain[1])
        functions = run_out.derivatives(inside, order)
        if theta != inside:
            functions[0] += (theta - inside) * run_out.derivatives(inside, 1)[1]
            functions[2:] = 0.0
        return piece, functions

    def beyond(self, theta: ca.SX, order: int) -> ca.SX:
        """Return `derivatives` for a parameter beyond an end, as an expression."""
        first, last = (_gone_out(run_out, theta, order) for run_out in self.run_outs)
        return ca.if_else(theta > self._end, last, first)

    def _own(self, theta: float, order: int) -> tuple[int, np.ndarray]:
        piece, values = self._sample(theta)
        return piece, self._powers[: order + 1] @ np.array(values)


def _gone_out(run_out: RunOut, theta: ca.SX, order: int) -> ca.SX:
    """Return derivatives 0..order along a run-out and its straight end, [order + 1, size]."""
    inside = ca.fmin(ca.fmax(theta, run_out.domain[0]), run_out.domain[1])
    rows = run_out.expression(inside, order)
    straight = [rows[0, :] + (theta - inside) * rows[1, :], rows[1, :]]
    further = ca.vertcat(*straight[: order + 1], ca.SX(max(order - 1, 0), run_out.dimension))
    return ca.densify(ca.if_else(theta == inside, rows, further))


def _straightening(
    surface: ProductSurface, axis: int, theta: float, order: int, longest: float
) -> float:
    """Return a length in which no line across a border gets far from straight."""
    other = surface.domain[1 - axis]
    orders = partial_orders(order)
    rows = [orders.index((n, 0) if axis == 0 else (0, n)) for n in range(order + 1)]
    lengths = []
    for value in np.linspace(*other, _SAMPLES):
        point = (theta, value) if axis == 0 else (value, theta)
        lengths.append(straightening_length(surface.partials(point, order)[rows], longest))
    return min(lengths)


class SurfaceTable:
    """Sum of products as an expression: its cell is looked up, coefficients multiply functions.

    Args:
        surface: A `ProductSurface`, or an extended one, which decides over parameters beyond the
            ends of open directions.

    Raises:
        InputError: Another kind of surface.
    """

    def __init__(self, surface: Surface) -> None:
        inner = surface.inner if isinstance(surface, ExtendedSurface) else checked_product(surface)
        pieces_1, self._pieces, self._size_1, self._size_2, _ = inner.coefficients.shape
        # of each cell by columns: theta_1's functions, components, theta_2's functions
        cells = inner.coefficients.transpose(0, 1, 3, 4, 2).reshape(pieces_1 * self._pieces, -1)
        self._cells = ca.MX(ca.DM(cells.T))
        outside = surface.beyond if isinstance(surface, ExtendedSurface) else (None, None)
        self._directions = [
            _TableDirection(basis, beyond)
            for basis, beyond in zip(inner.bases, outside, strict=True)
        ]

    def __call__(self, theta: ca.MX, order: int) -> ca.MX:
        """Return all partial derivatives up to a total order, shape (3, count), see `partials`.

        Args:
            theta: Unwrapped parameters, shape (2,).
            order: Highest total order, 0 to 6.
        """
        p, first = self._directions[0](theta[0], order)
        q, second = self._directions[1](theta[1], order)
        cell = ca.reshape(self._cells[:, self._pieces * p + q], self._size_1, -1)
        along = ca.reshape(first @ cell, 3 * (order + 1), self._size_2)
        every = ca.vec(along @ second.T)
        n = order + 1
        chosen = [i + n * (c + 3 * j) for i, j in partial_orders(order) for c in range(3)]
        return ca.reshape(every[chosen], 3, -1)


class _TableDirection:
    """The functions of one parameter with their derivatives.

    Args:
        basis: The functions.
        beyond: The functions beyond the ends, or None if they are continued as such.
    """

    def __init__(self, basis: Basis, beyond: Beyond | None) -> None:
        self._basis, self._beyond = basis, beyond
        self._piece = piece_function(basis.breakpoints)
        self._functions: dict[int, ca.Function] = {}

    def __call__(self, theta: ca.MX, order: int) -> tuple[ca.MX, ca.MX]:
        """Return the number of the piece, and derivatives 0..order, shape (order + 1, size)."""
        basis = self._basis
        begin, end = float(basis.breakpoints[0]), float(basis.breakpoints[-1])
        wrapped = theta
        if basis.closed:
            wrapped = theta - ca.floor((theta - begin) / (end - begin)) * (end - begin)
        piece, from_begin = self._piece(wrapped)
        u = from_begin if basis.is_local else wrapped
        if order not in self._functions:
            self._functions[order] = self._function(order)
        outside = ca.logic_or(theta < begin, theta > end)
        return piece, self._functions[order](outside, u, theta)

    def _function(self, order: int) -> ca.Function:
        """Return ``(outside, u, theta) -> derivatives 0..order``."""
        outside, u, theta = (ca.SX.sym(name) for name in ("outside", "u", "theta"))
        own = self._basis.function(order)
        if self._beyond is None:
            return ca.Function("functions", [outside, u, theta], [own(u)])
        inside = ca.Function("inside", [u, theta], [own(u)])
        beyond = ca.Function("beyond", [u, theta], [self._beyond(theta, order)])
        return ca.Function.if_else("functions", beyond, inside)
