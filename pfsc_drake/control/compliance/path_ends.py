"""The ends of an open path as walls for a compliant reference."""

from dataclasses import dataclass
from typing import Any

import casadi as ca

from pfsc_drake.blocks.cases import where
from pfsc_drake.control.compliance.impedance import (
    ImpedanceLaw,
    ImpedanceState,
    transition_of,
)

# m/s; tolerance of an external reference that its derivatives do not predict exactly
_SLACK = 1e-6


@dataclass(frozen=True)
class PathEnds:
    """Limits of the compliant reference of one coordinate at the ends of an open path.

    With h the distance of ``y_p`` from an end, and all speeds towards it, at the end of a period

        y_p' <= max(h / T_e, y_d' min(1, h / h_d))

    so that ``y_p`` comes to rest at the end with the time constant T_e. The second term allows an
    external reference ``y_d``, at the distance h_d, to arrive as planned. The speed is reduced by a
    force away from the end that is constant over a period, like an external force. It is limited to
    the force after which ``y_p`` has not moved: its work on the motion is never positive, and the
    impedance remains passive (docs/theory/fixtures.md). Beyond an end, h < 0, there is no force
    back and no motion further outwards.

    Attributes:
        law: Impedance of all coordinates.
        index: Number of the coordinate.
        ends: Its least and its largest value [m].
        settling: ``T_e`` [s].
    """

    law: ImpedanceLaw
    index: int
    ends: tuple[float, float]
    settling: float

    def hold(
        self, now: ImpedanceState, free: ImpedanceState, desired: Any, impedance: Any = None
    ) -> ImpedanceState:
        """Return the state one period later, between the ends.

        Args:
            now: State at the last tick.
            free: State one period later without ends.
            desired: Derivatives of y_d by rows, as for :meth:`ImpedanceLaw.update`.
            impedance: Impedance for the update, as for :meth:`ImpedanceLaw.update`.
        """
        law, k, m = self.law, slice(self.index, self.index + 1), self.law.num_outputs
        position, velocity = now.position[k], free.velocity[k]
        y_d, v_d = desired[:m][k], law.extrapolate(desired)[1][k]
        (_, b, _, _, p), rates = transition_of(free.impedance, law.period)
        speed = velocity
        for end, sign in zip(self.ends, (-1.0, 1.0), strict=True):
            h, h_d = sign * (end - position), sign * (end - y_d)
            share = where(h < h_d, ca.fmax(h, 0.0) / h_d, 1.0)
            planned = where(sign * v_d > 0.0, sign * v_d * share + _SLACK, 0.0)
            # speed after the force for which y_p does not move
            step = ca.fmax(sign * (free.position[k] - position), 0.0)
            still = sign * velocity - b[k] / p[k] * step
            most = ca.fmax(ca.fmax(h / self.settling, planned), ca.fmax(still, 0.0))
            speed = where(sign * speed > most, sign * most, speed)
        push = law.push_to(free, speed, free.force, k)
        limited, _ = law.update(now, desired, push, impedance)
        meets = ca.logic_and(rates.compliant[k], speed != velocity)
        return ImpedanceState(*[where(meets, a, c) for a, c in zip(limited, free, strict=True)])
