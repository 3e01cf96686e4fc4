"""An operator whose hand guides the tool."""

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from pfsc_drake.errors import InputError
from pfsc_drake.physics.hand_model import HandModel, HandParameters, Place, observed_twist
from pfsc_drake.systems.physics.bus_delay import MAX_PERIODS


class OperatorHand(LeafSystem):
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
        Discrete: wrench, shape (6,); last tool pose, shape (12,), NaN before the first;
        wrenches that are wanted but not delivered yet, latest first, shape (6 n,).

    Args:
        parameters: Properties of the hand.
        period: Sampling time [s].
        place: Where coordinates of the frame ``manifold`` are in the world, if needed.

    Raises:
        InputError: If the reaction delay is not a multiple of the period, up to MAX_PERIODS of
            it, or a path is missing.
    """

    def __init__(
        self, parameters: HandParameters, period: float, place: Place | None = None
    ) -> None:
        super().__init__()
        self._hand, self._period = HandModel(parameters, place), period
        delay = round(min(parameters.reaction_delay / period, MAX_PERIODS))
        if abs(delay * period - parameters.reaction_delay) > 1e-9:
            raise InputError(
                f"reaction_delay = {parameters.reaction_delay} s: must be a multiple of the "
                f"sampling time {period:g} s, up to {MAX_PERIODS * period:g} s"
            )
        self._wrench = self.DeclareDiscreteState(6)
        self._last_pose = self.DeclareDiscreteState(np.full(12, np.nan))
        self._waiting = self.DeclareDiscreteState(6 * delay)
        self._tool_pose = self.DeclareVectorInputPort("tool_pose", 12)
        self.DeclareStateOutputPort("wrench", self._wrench)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _wanted(self, context: Context, pose: np.ndarray) -> np.ndarray:
        if not np.isfinite(pose).all():
            return np.zeros(6)
        last = context.get_discrete_state(self._last_pose).value()
        known = np.isfinite(last).all()
        twist = observed_twist(last, pose, self._period) if known else np.zeros(6)
        return self._answer(context, pose, twist)

    def _answer(self, context: Context, pose: np.ndarray, twist: np.ndarray) -> np.ndarray:
        """Return the wrench that the hand wants, having seen a pose and a twist."""
        return self._hand.wanted(context.get_time(), pose[:3], twist, pose[3:].reshape(3, 3))

    def _update(self, context: Context, state: DiscreteValues) -> None:
        pose = self._tool_pose.Eval(context)
        waiting = context.get_discrete_state(self._waiting).value()
        queue = np.concatenate([self._wanted(context, pose), waiting])
        state.set_value(self._wrench, self._hand.delivered(context.get_time(), queue[-6:]))
        state.set_value(self._waiting, queue[: len(waiting)])
        state.set_value(self._last_pose, pose)
