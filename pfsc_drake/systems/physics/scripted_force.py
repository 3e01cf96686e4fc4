"""An operator who does what was written down beforehand."""

import math

from pydrake.systems.framework import BasicVector, Context, DiscreteValues, EventStatus, LeafSystem

from pfsc_drake.control.manifolds.manifold import Manifold
from pfsc_drake.physics.force_profile import ForceProfile

# how long before a force the manifold is looked at
_TICKS_AHEAD = 100


class ScriptedForce(LeafSystem):
    """Force and torque at the tool point over time, see :class:`ForcePulse`.

    The value follows the time continuously. Directions in manifold coordinates are
    those of the manifold's point at the last tick; a point that is not finite leaves
    them as they were. The manifold is looked at while there is a force or will be soon.

    Ports:
        manifold_point (input): Where on the manifold the tool is; only if a pulse is given in
            manifold coordinates.
        wrench (output): ``[force, torque]`` on the robot at the tool point, world axes,
            shape (6,) [N, Nm].

    State:
        Discrete: the matrix with the manifold's axes as columns, by rows, shape (9,); zero
        before initialization.

    Args:
        profile: The profile.
        manifold: The manifold that the tool follows.
        period: Time between looks at the manifold [s].
    """

    def __init__(self, profile: ForceProfile, manifold: Manifold, period: float) -> None:
        super().__init__()
        self._profile, self._axes_at = profile, manifold.axes
        self._ahead = _TICKS_AHEAD * period
        axes = self.DeclareDiscreteState(9)
        self.DeclareVectorOutputPort(
            "wrench",
            6,
            self._calc_wrench,
            prerequisites_of_calc={self.time_ticket(), self.discrete_state_ticket(axes)},
        )
        if profile.needs_manifold:
            size = manifold.layout.size
            self._manifold_point = self.DeclareVectorInputPort("manifold_point", size)
            self.DeclareInitializationDiscreteUpdateEvent(self._look)
            self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._look)

    def _calc_wrench(self, context: Context, output: BasicVector) -> None:
        axes = context.get_discrete_state_vector().value().reshape(3, 3)
        output.SetFromVector(self._profile.at(context.get_time(), axes))

    def _look(self, context: Context, state: DiscreteValues) -> EventStatus:
        time = context.get_time()
        if not self._profile.is_active(time, time + self._ahead):
            return EventStatus.DidNothing()
        axes = self._axes_at(self._manifold_point.Eval(context))
        # a sum is finite only if all its terms are
        if math.isfinite(axes.sum()):
            state.set_value(axes.ravel())
        return EventStatus.Succeeded()
