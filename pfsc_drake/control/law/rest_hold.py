"""Constant torques for sticking drives while the reference rests.

With a sticking motor (stiffness k and damping c of its presliding), an elastic joint of link
inertia M and motor inertia D under the exact law with the characteristic polynomial
``p(s) = s^4 + a_3 s^3 + a_2 s^2 + a_1 s + a_0`` obeys::

    p(s) + (k + c s) / D (s^2 + w^2) = 0,   w^2 = K_s / M

For large k one pair of its roots goes to ``+-j w``, a link that oscillates on its motor, with the
real part ``D (a_3 w^2 - a_1) / (2 k)``: it is unstable where ``w^2 > a_1 / a_3``, which is 130
rad/s for poles at -60, -60, -250 and -350 1/s. A friction observer of rate L adds
``D L Re p(j w) / (2 k w^2)``. No practicable gains stabilize every stiffness k; constant torques
do: a sticking drive is then passive.
"""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Values
from pfsc_drake.blocks.cases import where

# derivatives of the reference below which it rests, in SI units
_RESTS = 1e-6
# rates of a posture [rad/s or m/s], and of the manifold's frame [m/s, 1/s], below which they rest:
# a posture settles slowly, and a frame is measured
_POSTURE_RESTS, _FRAME_RESTS = 1e-4, 5e-3
# position of a motor before the reference rests [rad or m]
_NOWHERE = 1e9
# share of the friction torque of a motor that has stopped
_TAKEN_BACK = 0.5


def reference_rests(motion: Any, posture_rate: Any | None, frame_rate: Any | None) -> Any:
    """Return whether the references are at rest.

    Args:
        motion: Derivatives 1..r of the reference [m or rad, per s, ..].
        posture_rate: First derivative of the posture reference, if there is one [rad/s or m/s].
        frame_rate: First derivative of the manifold's frame, if it moves [m/s, 1/s].
    """
    rests = _largest(motion) < _RESTS
    for rate, bound in ((posture_rate, _POSTURE_RESTS), (frame_rate, _FRAME_RESTS)):
        if rate is not None:
            rests = ca.logic_and(rests, _largest(rate) < bound)
    return rests


@dataclass(frozen=True, eq=False)
class RestHold:
    """Hold of the mean torques while the reference rests and the motors do not move.

    The motors do not move if their mean position over ``settling`` samples, independent of
    oscillations, is within ``drift`` of the mean before. Then the mean torques of these samples
    are held. A motor that has just stopped is about to slide, as its drive overcomes all of the
    friction: half of the friction torque is taken back over the next ``settling`` samples, so that
    friction balances forces in both directions. Oscillations must stay within ``shaking`` of the
    mean until then, and within ``window`` from then on. From the first sample on in which the
    reference, a motor or the manifold's frame moves, the law is active again. So a force that moves
    no motor is balanced by friction.

    Attributes:
        coulomb: Nominal ``f_c``, shape (N,) [Nm or N].
        drift: Largest change of a mean position of a motor at rest [rad or m].
        shaking: Largest displacement of a motor that comes to rest [rad or m].
        window: Largest displacement of a motor at rest [rad or m].
        settling: Samples of a mean, 2 or more.
        largest_error: Mean error of the virtual output up to which torques are held [m or rad].
        largest_change: Change of the error since then up to which they are held [m or rad].
    """

    coulomb: np.ndarray
    drift: float
    shaking: float
    window: float
    settling: int
    largest_error: float
    largest_change: float = np.inf

    def states(self, num_joints: int, num_outputs: int) -> dict[str, int]:
        """Return the sizes of the states.

        These are means of motor positions, torques of drives and of friction, and errors, since
        ``rest_ticks``; and the previous rest positions of the motors.

        Args:
            num_joints: N.
            num_outputs: m.
        """
        names = ("rest_position", "rest_drive", "rest_friction", "rest_before")
        return dict.fromkeys(names, num_joints) | {"rest_error": num_outputs, "rest_ticks": 1}

    def step(
        self, x: Values, q_M: Any, rests: Any, error: Any, drive: Any, friction: Any
    ) -> tuple[Any, Any, dict[str, Any]]:
        """Return whether torques are held, the drive torques, and the new states.

        Args:
            x: States, named as in :meth:`states`.
            q_M: Motor positions, shape (N, 1) [rad or m].
            rests: Whether the references are at rest, see :func:`reference_rests`.
            error: Error of the virtual output, shape (m, 1) [m or rad].
            drive: Command of the law, shape (N, 1) [Nm or N].
            friction: Friction torque in this command, shape (N, 1) [Nm or N].
        """
        ticks, settling = x.rest_ticks, self.settling
        # first the means of settling samples, then as many in which friction is taken back
        window = where(ticks >= 2 * settling, self.window, self.shaking)
        sticks = _largest(q_M - x.rest_before) < window
        if np.isfinite(self.largest_change):
            near = _largest(error - x.rest_error) < self.largest_change
            sticks = ca.logic_and(sticks, near)
        holds = ca.logic_and(ticks >= settling, ca.logic_and(rests, sticks))
        means = {}
        values = {"position": q_M, "drive": drive, "friction": friction, "error": error}
        for name, value in values.items():
            last = getattr(x, f"rest_{name}")
            mean = where(ticks == 0.0, value, last + (value - last) / (ticks + 1.0))
            means[f"rest_{name}"] = where(holds, last, mean)
        position = means["rest_position"]
        steady = ca.logic_and(
            _largest(position - x.rest_before) < self.drift,
            _largest(means["rest_error"]) < self.largest_error,
        )
        whole, counts = ticks == settling - 1, ca.logic_and(rests, ticks < settling)
        counts = ca.logic_and(counts, ca.logic_or(steady, ca.logic_not(whole)))
        goes_on = ca.logic_or(holds, counts)
        before = where(whole, position, where(ticks == 2 * settling - 1, q_M, x.rest_before))
        share = ca.fmin((ticks - settling) / settling, 1.0)
        coulomb = ca.DM(self.coulomb)
        overcome = ca.fmin(ca.fmax(x.rest_friction, -coulomb), coulomb)
        constant = x.rest_drive - _TAKEN_BACK * share * overcome
        states = means | {
            "rest_before": where(goes_on, before, where(whole, position, _NOWHERE)),
            "rest_ticks": where(goes_on, ca.fmin(ticks + 1.0, 2 * settling), 0.0),
        }
        return holds, where(holds, constant, drive), states


def _largest(values: Any) -> Any:
    return ca.mmax(ca.fabs(values))
