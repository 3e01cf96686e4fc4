"""The hand of a person at a screen."""

import math

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from pfsc_drake.physics.live_hand import ASKED, LiveHandModel, LiveHandParameters


class LiveHand(LeafSystem):
    """Does to the tool what a person asks for, see :class:`LiveHandModel`.

    It sees tool and person once per period, and holds its wrench until the next.

    Ports:
        asked (input): Push, world axes [N], 1 to hold and 0 not to, place to hold at, world axes
            [m], shape (7,).
        tool_pose (input): ``[y_t, R_e]``, shape (12,); see :class:`ToolKinematics`.
        wrench (output): ``[force, torque]`` on the robot at the tool point, world axes,
            shape (6,) [N, Nm]; zero before the first tick, and while the tool pose is not finite.

    State:
        Discrete: wrench, shape (6,); last tool pose, shape (12,), NaN before the first; lags of
        the hand, shape (14,).

    Args:
        parameters: Properties of the hand.
        period: Sampling time [s].
    """

    def __init__(self, parameters: LiveHandParameters, period: float) -> None:
        super().__init__()
        self._hand, self._period = LiveHandModel(parameters, period), period
        self._wrench = self.DeclareDiscreteState(6)
        self._last_pose = self.DeclareDiscreteState(np.full(12, np.nan))
        self._lags = self.DeclareDiscreteState(self._hand.rest)
        self._asked = self.DeclareVectorInputPort("asked", ASKED)
        self._tool_pose = self.DeclareVectorInputPort("tool_pose", 12)
        self.DeclareStateOutputPort("wrench", self._wrench)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        pose, asked = self._tool_pose.Eval(context), self._asked.Eval(context)
        last = context.get_discrete_state(self._last_pose).value()
        state.set_value(self._last_pose, pose)
        # a sum is finite only if all its terms are
        if not math.isfinite(pose.sum()):
            state.set_value(self._wrench, np.zeros(6))
            return
        lags, wrench = self._hand.advance(
            context.get_discrete_state(self._lags).value(),
            asked,
            last if math.isfinite(last.sum()) else pose,
            pose,
        )
        state.set_value(self._wrench, wrench)
        state.set_value(self._lags, lags)
