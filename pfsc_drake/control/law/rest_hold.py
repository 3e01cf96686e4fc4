"""Constant torques for drives that stick while the reference rests.

With a motor that sticks (stiffness k and damping c of its presliding), an elastic joint of link
inertia M and motor inertia D under the exact law with the characteristic polynomial
``p(s) = s^4 + a_3 s^3 + a_2 s^2 + a_1 s + a_0`` obeys::

    p(s) + (k + c s) / D (s^2 + w^2) = 0,   w^2 = K_s / M

For large k one pair of its roots goes to ``+-j w``, the link that swings on a motor at rest, with
the real part ``D (a_3 w^2 - a_1) / (2 k)``: it is unstable where ``w^2 > a_1 / a_3``, which is 130
rad/s for poles at -60, -60, -250 and -350 1/s. A friction observer of rate L adds
``D L Re p(j w) / (2 k w^2)``. No gains that a robot can bear are right for every stiffness k;
constant torques are: what sticks is then passive.
"""

from dataclasses import dataclass
from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Values
from pfsc_drake.blocks.cases import where

# derivatives of the reference below which it rests, in SI units
_RESTS = 1e-6
# share of the friction torque of a motor that has stopped
_TAKEN_BACK = 0.5


@dataclass(frozen=True)
class RestHold:
    """Holds the mean torque once the reference rests and every drive sticks.

    A drive sticks while its motor stays within ``shaking`` of where it was. The torques are held
    after ``settling`` ticks, what shakes comes to rest in as many, and from then on a drive sticks
    while its motor stays within ``window``. A motor that has just stopped is at the edge of sliding
    on, as the drive overcomes all of its friction: half of that is taken back while what shakes
    comes to rest, so that friction can bear forces in both directions. In the tick in which the
    reference or a drive moves the law goes on. So a force that moves no drive is left to friction.

    Attributes:
        shaking: Largest displacement of a motor before [rad or m].
        window: Largest displacement of one that has come to rest [rad or m].
        settling: Ticks after which the torques are held, 1 or more.
        largest_error: Error of the virtual output up to which they are [m or rad].
    """

    shaking: float
    window: float
    settling: int
    largest_error: float

    def states(self, num_joints: int) -> dict[str, int]:
        """Return the sizes of the states.

        Those are where drives stick, their mean torque, that of friction, and ticks since.

        Args:
            num_joints: N.
        """
        names = ("rest_position", "rest_drive", "rest_friction")
        return dict.fromkeys(names, num_joints) | {"rest_ticks": 1}

    def step(
        self, x: Values, q_M: Any, motion: Any, error: Any, drive: Any, friction: Any
    ) -> tuple[Any, Any, dict[str, Any]]:
        """Return whether torques are held, those that the drives get, and the new states.

        Args:
            x: States, named as in :meth:`states`.
            q_M: Motor positions, shape (N, 1) [rad or m].
            motion: Derivatives of the reference [m or rad, per s, ..].
            error: Error of the virtual output, shape (m, 1) [m or rad].
            drive: What the law tells the drives, shape (N, 1) [Nm or N].
            friction: What it overcomes of friction by that, shape (N, 1) [Nm or N].
        """
        whole = 2 * self.settling
        window = where(x.rest_ticks >= whole, self.window, self.shaking)
        sticks = ca.mmax(ca.fabs(q_M - x.rest_position)) < window
        rests = ca.logic_and(sticks, ca.mmax(ca.fabs(motion)) < _RESTS)
        holds = ca.logic_and(rests, x.rest_ticks >= self.settling)
        # once held, an error within the window is nothing new
        near = ca.logic_or(holds, ca.mmax(ca.fabs(error)) < self.largest_error)
        settles = ca.logic_and(rests, near)
        stays = ca.logic_and(rests, x.rest_ticks != whole - 1)
        means = {}
        for name, value in (("rest_drive", drive), ("rest_friction", friction)):
            last = getattr(x, name)
            mean = last + (value - last) / (x.rest_ticks + 1.0)
            means[name] = where(holds, last, where(settles, mean, 0.0 * value))
        share = ca.fmin((x.rest_ticks - self.settling) / self.settling, 1.0)
        held = x.rest_drive - _TAKEN_BACK * share * x.rest_friction
        states = {
            "rest_position": where(stays, x.rest_position, q_M),
            **means,
            "rest_ticks": where(settles, ca.fmin(x.rest_ticks + 1.0, whole), 0.0),
        }
        return holds, where(holds, held, drive), states
