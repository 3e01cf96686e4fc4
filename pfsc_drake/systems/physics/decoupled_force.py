"""An operator who holds the robot back along its path."""

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, EventStatus, LeafSystem

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.physics.decoupled_force import decoupled_force_function
from pfsc_drake.physics.force_profile import smooth_pulse
from pfsc_drake.robot.robot_model import RobotModel


class DecoupledForce(LeafSystem):
    """A pulse of the wrench of :func:`decoupled_force_function`.

    The wrench's direction is that of the last tick; its size follows the time smoothly.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        manifold_point (input): The path next to the tool.
        wrench (output): ``[force, torque]`` on the robot at the tool point, world axes,
            shape (6,) [N, Nm].

    State:
        Discrete: the wrench of unit size, shape (6,).

    Args:
        robot: A robot with six axes.
        manifold: A path with orientation.
        pulse: ``begin, end, ramp`` [s] and ``force`` along the tangent [N].
        period: Sampling time [s].
    """

    def __init__(
        self,
        robot: RobotModel,
        manifold: PathManifold,
        pulse: tuple[float, float, float, float],
        period: float,
    ) -> None:
        super().__init__()
        function = BoundFunction(decoupled_force_function(robot, manifold))
        self._q, self._point = function.arguments.values()
        (self._unit,), self._evaluate = function.results.values(), function.evaluate
        self._begin, self._end, self._ramp, self._force = pulse
        unit = self.DeclareDiscreteState(6)
        self._joint_state = self.DeclareVectorInputPort("joint_state", 4 * robot.dimension)
        self._manifold_point = self.DeclareVectorInputPort("manifold_point", manifold.layout.size)
        self.DeclareVectorOutputPort(
            "wrench",
            6,
            self._calc_wrench,
            prerequisites_of_calc={self.time_ticket(), self.discrete_state_ticket(unit)},
        )
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._look)

    def _calc_wrench(self, context: Context, output: BasicVector) -> None:
        size = self._force * smooth_pulse(context.get_time(), self._begin, self._end, self._ramp)
        output.SetFromVector(size * context.get_discrete_state_vector().value())

    def _look(self, context: Context, state: DiscreteValues) -> EventStatus:
        # nothing is needed of the direction while there is no force
        if self._begin - 0.1 <= context.get_time() <= self._end:
            self._q[:] = self._joint_state.Eval(context)[: len(self._q)]
            self._point[:] = self._manifold_point.Eval(context)
            self._evaluate()
            if np.isfinite(self._unit).all():
                state.set_value(self._unit)
        return EventStatus.Succeeded()
