"""A hand on a link of an arm."""

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from pfsc_drake.physics.link_hand import LinkHandModel, LinkHandParameters


class LinkHand(LeafSystem):
    """A spring-damper from a point of a link to a hand that moves, see :class:`LinkHandModel`.

    The hand sees the point once per period, takes its velocity from the last two looks, and
    holds its force until the next.

    Ports:
        point (input): Where the point is in the world, shape (3,) [m].
        wrench (output): ``[force, torque]`` on the robot at the point, world axes, the torque
            zero, shape (6,) [N, Nm]; zero before the hand takes hold.

    State:
        Discrete: wrench, shape (6,); the point at the last look, shape (3,), NaN before the
        first; where it was when the hand took hold, shape (3,), NaN before.

    Args:
        parameters: Properties of the hand.
        period: Sampling time [s].
    """

    def __init__(self, parameters: LinkHandParameters, period: float) -> None:
        super().__init__()
        self._hand, self._period = LinkHandModel(parameters), period
        self._wrench = self.DeclareDiscreteState(6)
        self._last = self.DeclareDiscreteState(np.full(3, np.nan))
        self._start = self.DeclareDiscreteState(np.full(3, np.nan))
        self._point = self.DeclareVectorInputPort("point", 3)
        self.DeclareStateOutputPort("wrench", self._wrench)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _update(self, context: Context, state: DiscreteValues) -> None:
        time, point = context.get_time(), self._point.Eval(context)
        last = context.get_discrete_state(self._last).value()
        start = context.get_discrete_state(self._start).value()
        if np.isnan(start).any() and self._hand.holds(time):
            start = point
        velocity = (point - last) / self._period
        force = self._hand.force(time, point, velocity, start)
        # not finite: before it takes hold, without a last look, or where the robot is not
        held = force if np.isfinite(force).all() else np.zeros(3)
        state.set_value(self._wrench, np.concatenate([held, np.zeros(3)]))
        state.set_value(self._last, point)
        state.set_value(self._start, start)
