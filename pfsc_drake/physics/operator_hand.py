"""An operator whose hand guides the tool."""

from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, where
from pfsc_drake.errors import InputError
from pfsc_drake.physics.hand_model import HandModel, HandParameters, observed_twist, orientation
from pfsc_drake.physics.hand_way import Place

MAX_PERIODS = 10_000  # in a reaction delay; every wrench of it is moved at every tick


class OperatorHand(Block):
    """A spring-damper from the tool point to a moving target, see :class:`HandModel`.

    The hand sees the tool once per period, takes its velocity from the last two looks,
    and holds its wrench until the next: a reaction delay of n periods means that the
    wrench from t_k to t_{k+1} answers what was seen at t_{k-n}.

    Ports:
        tool_pose (input): ``[y_t, R_e]``, shape (12,); see :class:`ToolKinematics`.
        wrench (output): ``[force, torque]`` on the robot at the tool point, world axes,
            shape (6,) [N, Nm]; zero before the first tick. A tool pose that is not
            finite makes the hand let go for one reaction.

    State:
        wrench; last_pose, and whether the tool was ``seen`` then; wrenches that are wanted but not
        delivered yet (``waiting``), latest first, shape (6 n,).

    Args:
        parameters: Properties of the hand.
        period: Sampling time [s].
        place: Where coordinates of the frame ``manifold`` are in the world, if needed.

    Raises:
        InputError: If the reaction delay is not a multiple of the period, up to MAX_PERIODS of
            it, or a path is missing.
    """

    expands = False  # tables

    def __init__(
        self, parameters: HandParameters, period: float, place: Place | None = None
    ) -> None:
        self._hand, self._period = HandModel(parameters, place), period
        delay = round(min(parameters.reaction_delay / period, MAX_PERIODS))
        if abs(delay * period - parameters.reaction_delay) > 1e-9:
            raise InputError(
                f"reaction_delay = {parameters.reaction_delay} s: must be a multiple of the "
                f"sampling time {period:g} s, up to {MAX_PERIODS * period:g} s"
            )
        self.inputs = {"tool_pose": Port(12, "m, 1")}
        self.outputs = {"wrench": Port(6, "N, Nm")}
        self.states = {"wrench": 6, "last_pose": 12, "seen": 1, "waiting": 6 * delay}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        return {"wrench": x.wrench}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the next tick; what is left out stays."""
        time, sees = t * self._period, all_finite(u.tool_pose)
        twist = where(x.seen, observed_twist(x.last_pose, u.tool_pose, self._period), 0.0)
        wanted = where(sees, self.wanted(x, time, u.tool_pose, twist), 0.0)
        queue = ca.vertcat(wanted, x.waiting)
        return {
            "wrench": self._hand.delivered(time, queue[-6:]),
            "last_pose": u.tool_pose,
            "seen": sees,
            "waiting": queue[:-6],
        }

    def wanted(self, x: Values, time: Any, pose: Any, twist: Any) -> Any:
        """Return the wrench that the hand wants, world axes, shape (6,) [N, Nm].

        Args:
            x: States.
            time: [s].
            pose: ``[y_t, R_e by rows]``, shape (12,).
            twist: ``[y_t', w]``, shape (6,).
        """
        return self._hand.wanted(time, pose[:3], twist, orientation(pose))
