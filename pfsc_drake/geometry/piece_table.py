"""Piecewise polynomials as expressions: the piece is looked up, its coefficients are constants."""

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike


class PieceTable:
    """Polynomials of u = theta - theta_s on each piece s of an interval, several of them at once.

    Before the first piece and after the last, their polynomials go on. A parameter that is not a
    number has values that are none.

    Args:
        breakpoints: theta_s and the last end, increasing, [pieces + 1].
        coefficients: Lowest power first, [pieces, quantities, powers].
    """

    def __init__(self, breakpoints: ArrayLike, coefficients: ArrayLike) -> None:
        breaks, table = np.asarray(breakpoints, float), np.asarray(coefficients, float)
        pieces, self.quantities, self._powers = table.shape
        self._piece = piece_function(breaks)
        self._table = ca.MX(ca.DM(table.reshape(pieces, -1).T))
        self._power_row = _power_row(self._powers)

    def piece(self, theta: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Return the number of the piece that a parameter lies on, and u.

        Args:
            theta: Scalar.
        """
        piece, u = self._piece(theta)
        return piece, u

    def __call__(self, theta: ca.MX, first: int = 0, count: int | None = None) -> ca.MX:
        """Return values of neighbouring quantities, shape (count,).

        Args:
            theta: Scalar.
            first: Number of the first of them.
            count: How many; all by default.
        """
        count = self.quantities if count is None else count
        piece, u = self.piece(theta)
        n = self._powers
        own = ca.reshape(self._table[n * first : n * (first + count), piece], n, count)
        return ca.vec(self._power_row(u) @ own)


def piece_function(breakpoints: np.ndarray) -> ca.Function:
    """``theta -> number of the piece, theta - theta_s``; the first or last one from outside."""
    theta, table = ca.MX.sym("theta"), ca.MX(ca.DM(breakpoints))
    piece = ca.low(table, theta, {"lookup_mode": "binary"})
    return ca.Function("piece", [theta], [piece, theta - table[piece]])


def _power_row(count: int) -> ca.Function:
    """``u -> [1, u, u^2, ..]``, shape (1, count)."""
    u = ca.SX.sym("u")
    powers = [ca.SX(1.0), u]
    for j in range(2, count):
        powers.append(powers[j // 2] * powers[j - j // 2])
    return ca.Function("powers", [u], [ca.horzcat(*powers[:count])])
