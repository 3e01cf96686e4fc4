"""A surface that bears a tool like a spring along its normal."""

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

# (y_t, parameters of the foot of the last tick or None) -> height, normal, parameters of the foot
Touch = Callable[[np.ndarray, np.ndarray | None], tuple[float, np.ndarray, np.ndarray]]


class SurfaceSpring(LeafSystem):
    """A surface as a spring ``f = max(0, p - k h) n``, in place of computed contact.

    It has a slope wherever it is touched, and no state of its own between two ticks: what a loop
    is linearized with. It neither rubs nor damps.

    Ports:
        tool_pose (input): ``[y_t, R_e]``, shape (12,); see :class:`ToolKinematics`.
        wrench (output): ``[force, torque]`` on the tool at the tool point, world axes, shape (6,)
            [N, Nm].

    State:
        Discrete: parameters of the surface next to the tool, shape (2,), from which the next
        projection starts; NaN before initialization.

    Parameters:
        Numeric: stiffness k [N/m], and preload p [N], zero unless chosen.

    Args:
        touch: Height h over the surface [m], its normal n, and the parameters of the foot.
        stiffness: k [N/m].
        period: Time between two looks at where on the surface the tool is [s].

    Attributes:
        stiffness: k [N/m], unless another one is chosen.
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
        self.DeclareInitializationDiscreteUpdateEvent(self._look)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._look)

    def force(self, context: Context) -> float:
        """Return what it bears now [N].

        Args:
            context: The system's own.
        """
        stiffness, preload = context.get_numeric_parameter(0).value()
        return max(0.0, preload - stiffness * self._foot(context)[0])

    def set_stiffness(self, context: Context, stiffness: float, force: float) -> None:
        """Let it be another spring, that bears a force where the tool is now.

        Args:
            context: The system's own.
            stiffness: k [N/m].
            force: [N].
        """
        preload = force + stiffness * self._foot(context)[0]
        context.get_mutable_numeric_parameter(0).SetFromVector([stiffness, preload])

    def _foot(self, context: Context) -> tuple[float, np.ndarray, np.ndarray]:
        theta = context.get_discrete_state_vector().value()
        y_t = self._tool_pose.Eval(context)[:3]
        return self._touch(y_t, None if np.isnan(theta).any() else theta)

    def _calc_wrench(self, context: Context, output: BasicVector) -> None:
        stiffness, preload = context.get_numeric_parameter(0).value()
        height, normal, _ = self._foot(context)
        force = max(0.0, preload - stiffness * height)
        output.SetFromVector([*(force * normal), 0.0, 0.0, 0.0])

    def _look(self, context: Context, state: DiscreteValues) -> EventStatus:
        theta = self._foot(context)[2]
        # a tool that is nowhere must not make the place forgotten
        if np.isfinite(theta).all():
            state.set_value(theta)
        return EventStatus.Succeeded()
