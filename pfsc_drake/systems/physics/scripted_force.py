"""An operator who does what was written down beforehand."""

import math

from pydrake.systems.framework import BasicVector, Context, DiscreteValues, EventStatus, LeafSystem

from pfsc_drake.geometry import PathPointLayout
from pfsc_drake.geometry.paths.frame import manifold_axes
from pfsc_drake.physics.force_profile import ForceProfile

# how long before a force the path is looked at
_TICKS_AHEAD = 100


class ScriptedForce(LeafSystem):
    """Force and torque at the tool point over time, see :class:`ForcePulse`.

    The value follows the time continuously. Directions in manifold coordinates are
    those of the path point at the last tick; a path point that is not finite leaves
    them as they were. The path is looked at while there is a force or will be soon.

    Ports:
        path_point (input): From :class:`PathProjector`; only if a pulse is given in
            manifold coordinates.
        wrench (output): ``[force, torque]`` on the robot at the tool point, world axes,
            shape (6,) [N, Nm].

    State:
        Discrete: the matrix with the columns ``e_par, e_perp, e_cross``, by rows, shape
        (9,); zero before initialization.

    Args:
        profile: The profile.
        layout: Layout of the path point.
        period: Time between looks at the path [s].
    """

    def __init__(self, profile: ForceProfile, layout: PathPointLayout, period: float) -> None:
        super().__init__()
        self._profile, self._layout, self._ahead = profile, layout, _TICKS_AHEAD * period
        axes = self.DeclareDiscreteState(9)
        self.DeclareVectorOutputPort(
            "wrench",
            6,
            self._calc_wrench,
            prerequisites_of_calc={self.time_ticket(), self.discrete_state_ticket(axes)},
        )
        if profile.needs_path:
            self._path_point = self.DeclareVectorInputPort("path_point", layout.size)
            self.DeclareInitializationDiscreteUpdateEvent(self._look)
            self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._look)

    def _calc_wrench(self, context: Context, output: BasicVector) -> None:
        axes = context.get_discrete_state_vector().value().reshape(3, 3)
        output.SetFromVector(self._profile.at(context.get_time(), axes))

    def _look(self, context: Context, state: DiscreteValues) -> EventStatus:
        time = context.get_time()
        if not self._profile.is_active(time, time + self._ahead):
            return EventStatus.DidNothing()
        point = self._path_point.Eval(context)
        axes = manifold_axes(point[self._layout.position][3:6], point[self._layout.normal])
        # a sum is finite only if all its terms are
        if math.isfinite(axes.sum()):
            state.set_value(axes.ravel())
        return EventStatus.Succeeded()
