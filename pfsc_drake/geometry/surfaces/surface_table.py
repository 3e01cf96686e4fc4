"""Partial derivatives of a surface as expressions."""

import casadi as ca

from pfsc_drake.geometry.piece_table import piece_function
from pfsc_drake.geometry.surfaces.basis import Basis
from pfsc_drake.geometry.surfaces.extended import Beyond, ExtendedSurface
from pfsc_drake.geometry.surfaces.partials import partial_orders
from pfsc_drake.geometry.surfaces.product import checked_product
from pfsc_drake.geometry.surfaces.surface import Surface


class SurfaceTable:
    """Looks up the cell of a sum of products, and multiplies its coefficients with the functions.

    Args:
        surface: A `ProductSurface`, or one that is extended; parameters beyond the ends of open
            directions go on as it does.

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
            _Direction(basis, beyond) for basis, beyond in zip(inner.bases, outside, strict=True)
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


class _Direction:
    """The functions of one parameter with their derivatives.

    Args:
        basis: The functions.
        beyond: What they are beyond the ends, or None if they go on as they are.
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
        """``(outside, u, theta) -> derivatives 0..order``."""
        outside, u, theta = (ca.SX.sym(name) for name in ("outside", "u", "theta"))
        own = self._basis.function(order)
        if self._beyond is None:
            return ca.Function("functions", [outside, u, theta], [own(u)])
        inside = ca.Function("inside", [u, theta], [own(u)])
        beyond = ca.Function("beyond", [u, theta], [self._beyond(theta, order)])
        return ca.Function.if_else("functions", beyond, inside)
