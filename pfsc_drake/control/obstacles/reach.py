"""Earliest time at which an obstacle with bounded speed and acceleration can be near."""

from dataclasses import dataclass
from typing import Any

import casadi as ca

from pfsc_drake.blocks.cases import where


@dataclass(frozen=True)
class Reach:
    """Bounds of an obstacle's motion.

    The distance d of two convex bodies is a convex function of their positions. With n the measured
    unit vector from one to the other, the distance after t is at least

        d + int_0^t max(n v - A t', -V) dt'

    since the velocity n v along n decreases by A at most, and not below -V. The time until a gap
    is closed follows in closed form.

    Attributes:
        largest_speed: V [m/s].
        largest_acceleration: A [m/s^2]; None if unknown, then the measured velocity is ignored:
            ``gap / V``.
        velocity_uncertainty: Largest error of a measured velocity [m/s].
    """

    largest_speed: float
    largest_acceleration: float | None
    velocity_uncertainty: float

    def time(self, gap: Any, receding: Any) -> Any:
        """Return the time until a gap may be closed [s]; negative for a negative gap.

        Args:
            gap: Distance [m].
            receding: Measured velocity along n [m/s].
        """
        V, A = self.largest_speed, self.largest_acceleration
        if A is None:
            return gap / V
        v = ca.fmin(ca.fmax(receding - self.velocity_uncertainty, -V), V)
        braking, until = (v + V) / A, (V**2 - v**2) / (2.0 * A)
        early = (v + ca.sqrt(v**2 + 2.0 * A * ca.fmax(gap, 0.0))) / A
        late = braking + (gap - until) / V
        return where(gap > 0.0, where(gap < until, early, late), gap / V)
