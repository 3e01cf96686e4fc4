"""The friction Kalman filter as a system."""

from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiscreteValues,
    EventStatus,
    LeafSystem,
)

from pfsc_drake.control.estimation.friction_kalman import FrictionKalmanFilter


class FrictionEstimator(LeafSystem):
    """Friction of the drives by the Kalman filter of App. A, see :class:`FrictionKalmanFilter`.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        drive_torque (input): What the drives are told until the next tick, within their limits
            [Nm or N], shape (N,).
        known_torque (input, optional): External torques in rigid joints, as far as they are
            known, shape (N,); zero if not connected.
        velocity (input, optional): For which the friction torque is wanted [rad/s or m/s],
            shape (N,); the motors' measured one if not connected.
        estimate (output): ``[tau_f, f_c, f_v]``, shape (3N,). It does not depend on
            ``drive_torque``, so that what drives the joints may depend on it.
        friction_torque (output): ``tau_f`` alone, shape (N,).

    State:
        Discrete: the filter's memory.

    Args:
        kalman: The filter.
        period: Its sampling time [s].
    """

    def __init__(self, kalman: FrictionKalmanFilter, period: float) -> None:
        super().__init__()
        self._kalman, n = kalman, kalman.num_joints
        memory = self.DeclareDiscreteState(kalman.initial_memory)
        self._joint_state = self.DeclareVectorInputPort("joint_state", 4 * n)
        self._drive_torque = self.DeclareVectorInputPort("drive_torque", n)
        self._known_torque = self.DeclareVectorInputPort("known_torque", n)
        self._velocity = self.DeclareVectorInputPort("velocity", n)
        sources = {
            self._joint_state.ticket(),
            self._velocity.ticket(),
            self.discrete_state_ticket(memory),
        }
        self._estimate = self.DeclareVectorOutputPort(
            "estimate", 3 * n, self._calc_estimate, prerequisites_of_calc=sources
        )
        self.DeclareVectorOutputPort(
            "friction_torque", n, self._calc_torque, prerequisites_of_calc=sources
        )
        self.DeclareInitializationDiscreteUpdateEvent(self._start)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _calc_estimate(self, context: Context, output: BasicVector) -> None:
        velocity = self._velocity.Eval(context) if self._velocity.HasValue(context) else None
        memory = context.get_discrete_state_vector().value()
        output.SetFromVector(
            self._kalman.estimate(memory, self._joint_state.Eval(context), velocity)
        )

    def _calc_torque(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._estimate.Eval(context)[: self._kalman.num_joints])

    def _start(self, context: Context, state: DiscreteValues) -> EventStatus:
        state.get_mutable_value()[:] = self._kalman.initial_memory
        return EventStatus.Succeeded()

    def _update(self, context: Context, state: DiscreteValues) -> None:
        known = None
        if self._known_torque.HasValue(context):
            known = self._known_torque.Eval(context)
        self._kalman.remember(
            state.get_mutable_value(),
            self._joint_state.Eval(context),
            self._drive_torque.Eval(context),
            known,
        )
