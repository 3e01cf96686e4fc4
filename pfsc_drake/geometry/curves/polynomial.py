"""Piecewise polynomial curves, and tables of their pieces."""

import math

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import make_interp_spline

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.curve import Curve, check_order

# A jump counts if it exceeds this part of the largest derivative of its order ...
_RELATIVE_JUMP = 1e-9
# ... and would move the curve by more than this part of its size over one segment.
_ROUNDING = 1e-12
# of curves between rests
_DEGREE = 7


class PiecewisePolynomialCurve(Curve):
    """sigma(theta) = sum_j c_sj (theta - theta_s)^j on segment s.

    Args:
        breakpoints: theta_s and the last end, shape [segments + 1], increasing.
        coefficients: c_sj, shape [segments, degree + 1, dimension], lowest power first.
        closed: True if theta is periodic.
        known_smoothness: Class C^k that holds by construction; jumps of derivatives up
            to this order are rounding errors and ignored. The default measures all.

    Raises:
        InputError: wrong shapes, values that are not finite, or a curve that is not
            even continuous.
    """

    def __init__(
        self,
        breakpoints: ArrayLike,
        coefficients: ArrayLike,
        *,
        closed: bool = False,
        known_smoothness: int = -1,
    ) -> None:
        table = np.array(coefficients, dtype=float)
        if table.ndim != 3 or min(table.shape) < 1:
            raise InputError(
                f"coefficients: shape {table.shape}; [segments, degree + 1, dimension] is required"
            )
        super().__init__(table.shape[2], breakpoints, closed=closed, smoothness=math.inf)
        if len(table) != len(self.breakpoints) - 1:
            raise InputError(
                f"coefficients: {len(table)} segments;"
                f" {len(self.breakpoints)} breakpoints need {len(self.breakpoints) - 1}"
            )
        if not np.all(np.isfinite(table)):
            segment = int(np.argwhere(~np.isfinite(table))[0, 0])
            raise InputError(
                f"coefficients: value not finite in the segment from"
                f" theta = {self.breakpoints[segment]:.9g}"
            )
        table.setflags(write=False)
        self.coefficients = table
        self._lost_at = self._find_discontinuities(known_smoothness)
        lost = [order for order, theta in enumerate(self._lost_at) if theta is not None]
        if lost:
            if lost[0] == 0:
                raise InputError(
                    f"curve: jump of position at theta = {self._lost_at[0]:.9g};"
                    " a continuous curve is required"
                )
            self.smoothness = lost[0] - 1

    @classmethod
    def line(cls, start: ArrayLike, end: ArrayLike) -> "PiecewisePolynomialCurve":
        """Return the straight line parametrized by arc length.

        Args:
            start: First point [dimension], m.
            end: Last point [dimension], m.

        Returns:
            Open curve on the domain ``[0, |end - start|]``, m.

        Raises:
            InputError: the points coincide or are not finite.
        """
        a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
        if a.ndim != 1 or a.shape != b.shape:
            raise InputError(f"line: shapes {a.shape} and {b.shape}; two equal vectors required")
        length = float(np.linalg.norm(b - a))
        if not (0.0 < length < math.inf):
            raise InputError(
                f"line: from {a.tolist()} to {b.tolist()}; two different finite points required"
            )
        return cls([0.0, length], [[a, (b - a) / length]])

    @classmethod
    def between_rests(cls, theta: np.ndarray, points: np.ndarray) -> "PiecewisePolynomialCurve":
        """Return the curve of class C^6 through points, at rest at both ends.

        Args:
            theta: Parameters of the points, evenly spaced [points].
            points: Points [points, dimension].

        Returns:
            Open curve of degree 7; derivatives 1 to 3 are zero at its ends.
        """
        rest = [(k, np.zeros(points.shape[1])) for k in range(1, (_DEGREE + 1) // 2)]
        spline = make_interp_spline(theta, points, k=_DEGREE, bc_type=(rest, rest))
        table = [spline(theta[:-1], k) / math.factorial(k) for k in range(_DEGREE + 1)]
        coefficients = np.array(table).transpose(1, 0, 2)
        return cls(theta, coefficients, closed=False, known_smoothness=_DEGREE - 1)

    @property
    def degree(self) -> int:
        """Degree of the polynomials."""
        return self.coefficients.shape[1] - 1

    def first_discontinuity(self, order: int) -> float | None:
        """Return the parameter at which a derivative of at most this order first jumps."""
        thetas = [theta for theta in self._lost_at[: check_order(order) + 1] if theta is not None]
        return min(thetas, default=None)

    def derivatives(self, theta: ArrayLike, order: int) -> np.ndarray:
        """Return derivatives 0..order with respect to theta, for set-up and figures."""
        values = self._to_domain(theta)
        segment = np.searchsorted(self.breakpoints[1:-1], values, side="right")
        local = values - self.breakpoints[segment]
        powers = local[..., None] ** np.arange(self.degree + 1)
        table = self._table(order)
        return np.einsum("...kdj,...j->...kd", table[segment], powers)

    def _table(self, order: int) -> np.ndarray:
        """Return the map from powers to derivatives, [segments, order + 1, dimension, powers]."""
        segments, count, dimension = self.coefficients.shape
        table = np.zeros((segments, check_order(order) + 1, dimension, count))
        for k in range(min(order + 1, count)):
            for j in range(k, count):
                table[:, k, :, j - k] = math.perm(j, k) * self.coefficients[:, j, :]
        return table

    def _find_discontinuities(self, known_smoothness: int) -> list[float | None]:
        """Return for each order 0..degree the first parameter at which that derivative jumps."""
        lengths = np.diff(self.breakpoints)
        table = self._table(self.degree)
        powers = lengths[:, None] ** np.arange(self.degree + 1)
        left = table[..., 0]
        right = np.einsum("skdj,sj->skd", table, powers)
        if self.closed:
            jumps = np.roll(left, -1, axis=0) - right
            width = np.minimum(lengths, np.roll(lengths, -1))
        else:
            jumps = left[1:] - right[:-1]
            width = np.minimum(lengths[1:], lengths[:-1])
        jump = np.abs(jumps).max(axis=2, initial=0.0)
        scale = np.maximum(np.abs(left), np.abs(right)).max(axis=(0, 2))
        size = max(float(scale[0]), float(np.finfo(float).tiny))
        lost: list[float | None] = []
        for k in range(self.degree + 1):
            allowed = _RELATIVE_JUMP * scale[k] + _ROUNDING * size / width**k
            if k == 0:
                allowed = np.full_like(width, _RELATIVE_JUMP * size)
            jumps_here = np.flatnonzero(jump[:, k] > allowed)
            found = len(jumps_here) > 0 and k > known_smoothness
            lost.append(float(self.breakpoints[jumps_here[0] + 1]) if found else None)
        return lost


class PieceTable:
    """Polynomials of u = theta - theta_s on each piece s of an interval, for several quantities.

    Before the first piece and after the last, their polynomials are extrapolated. A NaN parameter
    has NaN values.

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
            count: Number of quantities; all by default.
        """
        count = self.quantities if count is None else count
        piece, u = self.piece(theta)
        n = self._powers
        own = ca.reshape(self._table[n * first : n * (first + count), piece], n, count)
        return ca.vec(self._power_row(u) @ own)


def piece_function(breakpoints: np.ndarray) -> ca.Function:
    """Return ``theta -> number of the piece, theta - theta_s``, an end piece from outside."""
    theta, table = ca.MX.sym("theta"), ca.MX(ca.DM(breakpoints))
    piece = ca.low(table, theta, {"lookup_mode": "binary"})
    return ca.Function("piece", [theta], [piece, theta - table[piece]])


def _power_row(count: int) -> ca.Function:
    """Return ``u -> [1, u, u^2, ..]``, shape (1, count)."""
    u = ca.SX.sym("u")
    powers = [ca.SX(1.0), u]
    for j in range(2, count):
        powers.append(powers[j // 2] * powers[j - j // 2])
    return ca.Function("powers", [u], [ca.horzcat(*powers[:count])])
