"""When an obstacle can be somewhere at the earliest, whatever it does."""

from dataclasses import dataclass
from typing import Any

import casadi as ca

from pfsc_drake.blocks.cases import where


@dataclass(frozen=True)
class Reach:
    """How an obstacle can move at most.

    The distance d of two convex bodies is a convex function of where they are. With n the unit
    vector from the one to the other as measured, it is at any later time at least

        d + int_0^t max(n v - A t', -V) dt'

    since n v is the velocity along n now, which falls by A at most and not below -V. The time
    until a gap is used up follows in closed form.

    Attributes:
        largest_speed: V [m/s].
        largest_acceleration: A [m/s^2]; None if it is not known, then a measured velocity says
            nothing: ``gap / V``.
        velocity_uncertainty: By how much a measured velocity may be wrong [m/s].
    """

    largest_speed: float
    largest_acceleration: float | None
    velocity_uncertainty: float

    def time(self, gap: Any, receding: Any) -> Any:
        """Return the time until a gap may be used up [s]; negative where there is none.

        Args:
            gap: [m].
            receding: Velocity along n as measured [m/s].
        """
        V, A = self.largest_speed, self.largest_acceleration
        if A is None:
            return gap / V
        v = ca.fmin(ca.fmax(receding - self.velocity_uncertainty, -V), V)
        braking, until = (v + V) / A, (V**2 - v**2) / (2.0 * A)
        early = (v + ca.sqrt(v**2 + 2.0 * A * ca.fmax(gap, 0.0))) / A
        late = braking + (gap - until) / V
        return where(gap > 0.0, where(gap < until, early, late), gap / V)
