"""Arc length of a curve and its inverse."""

import math
from bisect import bisect_right
from typing import overload

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.piecewise_fit import fit_pieces
from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve

_SPEED_DEGREE = 6
# Relative to the mean speed; the integral of an interpolation error is smaller still.
_SPEED_TOLERANCE = 1e-11
_INVERSION_STEPS = 60


class ArcLength:
    """s(theta), the integral of |sigma'| from the begin of the domain, (3.12).

    Tabulated once, to 1e-10 m, instead of summed up along the motion as in (3.73): it does
    not drift and does not depend on the motion along the path. On a closed curve
    every revolution adds the length; theta is not wrapped.

    Args:
        curve: Regular curve of any dimension.

    Attributes:
        length: Length of the curve (of one revolution), m.

    Raises:
        InputError: the curve is a point, or |sigma'| jumps between two breakpoints.
    """

    def __init__(self, curve: Curve) -> None:
        def speed(theta: np.ndarray) -> np.ndarray:
            return np.linalg.norm(curve.derivatives(theta, 1)[:, 1], axis=1, keepdims=True)

        begin, end = curve.domain
        mean = float(np.mean(speed(np.linspace(begin, end, 257)[1:-1])))
        breaks, speeds = fit_pieces(
            speed, curve.breakpoints, degree=_SPEED_DEGREE, tolerance=_SPEED_TOLERANCE * mean
        )
        lengths = np.diff(breaks)
        table = np.zeros((len(speeds), _SPEED_DEGREE + 2, 1))
        table[:, 1:, 0] = speeds[:, :, 0] / np.arange(1, _SPEED_DEGREE + 2)
        powers = lengths[:, None] ** np.arange(_SPEED_DEGREE + 2)
        pieces = np.einsum("sj,sj->s", table[:, :, 0], powers)
        sums = np.concatenate([[0.0], np.cumsum(pieces)])
        table[:, 0, 0] = sums[:-1]
        self.length = float(sums[-1])
        if not self.length > 0.0:
            raise InputError(f"curve: length {self.length:g} m; a regular curve is required")
        self._closed, self._revolutions = curve.closed, curve.revolutions
        self._begin, self._end = begin, end
        self._breaks, self._sums = breaks.tolist(), sums.tolist()
        self._function = PiecewisePolynomialCurve(breaks, table, known_smoothness=1)
        self._rows = list(table.transpose(0, 2, 1).copy())
        # Highest power first, for Horner's scheme.
        self._coefficients = table[:, ::-1, 0].tolist()

    @overload
    def __call__(self, theta: float) -> float: ...
    @overload
    def __call__(self, theta: np.ndarray) -> np.ndarray: ...
    def __call__(self, theta: float | np.ndarray) -> float | np.ndarray:
        """Return the arc length s(theta).

        Args:
            theta: Path parameter or array of them. Not wrapped: beyond the period of a
                closed curve s exceeds `length`, and is negative before its begin.
                Outside of an open curve the value at its end is returned.

        Returns:
            s, m, of the same shape.
        """
        if isinstance(theta, np.ndarray):
            revolutions = self._revolutions(theta)
            local = np.clip(theta - revolutions * (self._end - self._begin), self._begin, self._end)
            return self._function.derivatives(local, 0)[..., 0, 0] + revolutions * self.length
        revolution = 0
        if not self._begin <= theta <= self._end:
            if not self._closed:
                return 0.0 if theta < self._begin else self.length
            period = self._end - self._begin
            revolution = math.floor((theta - self._begin) / period)
            theta -= revolution * period
        piece = min(max(bisect_right(self._breaks, theta), 1), len(self._rows)) - 1
        u = theta - self._breaks[piece]
        u2 = u * u
        u3, u4 = u2 * u, u2 * u2
        powers = (1.0, u, u2, u3, u4, u2 * u3, u3 * u3, u3 * u4)
        return self._rows[piece].dot(powers).item() + revolution * self.length

    def parameter(self, s: float) -> float:
        """Return the parameter theta with arc length s.

        Args:
            s: Arc length, m: any number on a closed curve, [0, length] on an open one.

        Returns:
            theta with |s(theta) - s| < 1e-10 m, not wrapped.

        Raises:
            InputError: s is not finite or lies beyond an end of an open curve.
        """
        if not math.isfinite(s):
            raise InputError(f"arc length: {s}; a finite number of metres is required")
        slack = 1e-9 * self.length
        if not self._closed and not -slack <= s <= self.length + slack:
            raise InputError(f"arc length: {s:.9g} m; the open path has [0, {self.length:.9g}] m")
        revolutions = math.floor(s / self.length) if self._closed else 0
        target = min(max(s - revolutions * self.length, 0.0), self.length)
        piece = min(bisect_right(self._sums, target), len(self._breaks) - 1) - 1
        start, coefficients = self._breaks[piece], self._coefficients[piece]
        low, high = start, self._breaks[piece + 1]
        fraction = (target - self._sums[piece]) / (self._sums[piece + 1] - self._sums[piece])
        theta = low + (high - low) * fraction
        for _ in range(_INVERSION_STEPS):
            u = theta - start
            value = speed = 0.0
            for coefficient in coefficients:
                speed = value + u * speed
                value = coefficient + u * value
            # s increases: the root stays bracketed, and bisection replaces a step out of it.
            if value < target:
                low = theta
            else:
                high = theta
            step = (target - value) / speed if speed > 0.0 else math.inf
            if abs(step) <= 1e-15 * (self._end - self._begin):
                break
            theta = theta + step if low <= theta + step <= high else (low + high) / 2.0
        return theta + revolutions * (self._end - self._begin)
