"""How far a region has come: one coordinate over a clock."""

from typing import Protocol

import casadi as ca
import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve
from pfsc_drake.geometry.piece_table import PieceTable

# Jumps of a repeated course, of its extent (and of that over the square of its duration).
_SAME = 1e-9


class Course(Protocol):
    """One coordinate of a motion over a clock, of class C^2.

    Attributes:
        largest_rate: Of its absolute rate, m/s or rad/s.
    """

    largest_rate: float

    def at(self, clock: ca.MX) -> ca.MX:
        """Value at a time of the clock [s], m or rad, as an expression."""


class CurveCourse:
    """A course along a curve of dimension 1, whose parameter is the clock.

    Args:
        curve: Of class C^2, at rest at its ends; before and after it rests.
        repeat: Whether it begins again when it has ended.

    Attributes:
        largest_rate: See :class:`Course`.

    Raises:
        InputError: The curve has another dimension, is not of class C^2, or ends elsewhere than it
            begins and is to be repeated.
    """

    def __init__(self, curve: PiecewisePolynomialCurve, *, repeat: bool = False) -> None:
        if curve.dimension != 1 or curve.smoothness < 2:
            raise InputError(
                f"course: dimension {curve.dimension}, class C^{curve.smoothness:g}; 1 and C^2 or"
                " smoother are required"
            )
        self._begin, self._end = curve.domain
        self._period = curve.period
        self._repeat = repeat
        self._table = PieceTable(curve.breakpoints, curve.coefficients.transpose(0, 2, 1))
        ends = curve.derivatives(np.array(curve.domain), 2)[..., 0]
        extent = np.ptp(curve.derivatives(np.linspace(*curve.domain, 1001), 0))
        scales = extent / self._period ** np.arange(3)
        rates = np.abs(ends[:, 1:]) > _SAME * scales[1:]
        if np.any(rates):
            raise InputError(
                f"course: moves by {ends[:, 1].tolist()} a second at its ends; must be at rest"
                " there"
            )
        if repeat and abs(ends[1, 0] - ends[0, 0]) > _SAME * extent:
            raise InputError(
                f"course: begins at {ends[0, 0]:g} and ends at {ends[1, 0]:g}; both must be the"
                " same for it to repeat"
            )
        self.largest_rate = _largest_rate(curve)

    def at(self, clock: ca.MX) -> ca.MX:
        """See :class:`Course`."""
        if self._repeat:
            laps = ca.floor((clock - self._begin) / self._period)
            clock = clock - laps * self._period
        return self._table(ca.fmin(ca.fmax(clock, self._begin), self._end))


def _largest_rate(curve: PiecewisePolynomialCurve) -> float:
    """Largest absolute derivative, at ends of pieces or where the second one vanishes."""
    largest = 0.0
    for length, powers in zip(np.diff(curve.breakpoints), curve.coefficients[..., 0], strict=True):
        rate = np.polynomial.Polynomial(powers).deriv()
        turns = np.asarray(rate.deriv().roots(), dtype=complex).real
        within = turns[(turns > 0.0) & (turns < length)]
        largest = max(largest, float(np.abs(rate(np.array([0.0, length, *within]))).max()))
    return largest
