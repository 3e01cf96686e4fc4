"""A surface that supports a tool like a spring along its normal."""

from collections.abc import Callable

import numpy as np
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiscreteValues,
    EventStatus,
    LeafSystem,
    NumericParameterIndex,
)

# (y_t, parameters of the last closest point or None) -> height, normal, parameters of the new one
Touch = Callable[[np.ndarray, np.ndarray | None], tuple[float, np.ndarray, np.ndarray]]


class SurfaceSpring(LeafSystem):
    """A surface as a spring ``f = max(0, p - k h) n``, in place of computed contact.

    The force is differentiable in contact and has no state between two ticks, as the linearization
    of a loop requires. There is neither friction nor damping.

    Ports:
        tool_pose (input): ``[y_t, R_e]``, shape (12,); see :class:`ToolKinematics`.
        wrench (output): ``[force, torque]`` on the tool at the tool point, world axes, shape (6,)
            [N, Nm].

    State:
        Discrete: parameters of the closest point, shape (2,), from which the next projection
            starts; NaN before initialization.

    Parameters:
        Numeric: stiffness k [N/m], and preload p [N], zero unless set.

    Args:
        touch: Height h over the surface [m], its normal n, and the parameters of the closest point.
        stiffness: k [N/m].
        period: Time between two updates of the closest point [s].

    Attributes:
        stiffness: k [N/m], unless another one is set.
    """

    def __init__(self, touch: Touch, stiffness: float, period: float) -> None:
        super().__init__()
        self._touch, self.stiffness = touch, stiffness
        state = self.discrete_state_ticket(self.DeclareDiscreteState(np.full(2, np.nan)))
        parameters = self.numeric_parameter_ticket(
            NumericParameterIndex(self.DeclareNumericParameter(BasicVector([stiffness, 0.0])))
        )
        self._tool_pose = self.DeclareVectorInputPort("tool_pose", 12)
        self.DeclareVectorOutputPort(
            "wrench",
            6,
            self._calc_wrench,
            prerequisites_of_calc={self._tool_pose.ticket(), state, parameters},
        )
        self.DeclareInitializationDiscreteUpdateEvent(self._update)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def force(self, context: Context) -> float:
        """Return the normal force [N].

        Args:
            context: The system's own.
        """
        stiffness, preload = context.get_numeric_parameter(0).value()
        return max(0.0, preload - stiffness * self._projection(context)[0])

    def set_stiffness(self, context: Context, stiffness: float, force: float) -> None:
        """Set the stiffness, and the preload for a force at the present position of the tool.

        Args:
            context: The system's own.
            stiffness: k [N/m].
            force: [N].
        """
        preload = force + stiffness * self._projection(context)[0]
        context.get_mutable_numeric_parameter(0).SetFromVector([stiffness, preload])

    def _projection(self, context: Context) -> tuple[float, np.ndarray, np.ndarray]:
        theta = context.get_discrete_state_vector().value()
        y_t = self._tool_pose.Eval(context)[:3]
        return self._touch(y_t, None if np.isnan(theta).any() else theta)

    def _calc_wrench(self, context: Context, output: BasicVector) -> None:
        stiffness, preload = context.get_numeric_parameter(0).value()
        height, normal, _ = self._projection(context)
        force = max(0.0, preload - stiffness * height)
        output.SetFromVector([*(force * normal), 0.0, 0.0, 0.0])

    def _update(self, context: Context, state: DiscreteValues) -> EventStatus:
        theta = self._projection(context)[2]
        # a position that is not finite must not delete the closest point
        if np.isfinite(theta).all():
            state.set_value(theta)
        return EventStatus.Succeeded()
