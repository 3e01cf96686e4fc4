"""Friction or external torques in the joints, from what the joints did."""

from pydrake.systems.framework import BasicVector, Context, DiscreteValues, EventStatus, LeafSystem

from pfsc_drake.control.estimation.momentum_observer import MomentumObserver


class DisturbanceObserver(LeafSystem):
    """Observer of torques in the joints that nothing measures, see :class:`MomentumObserver`.

    With the momenta of :func:`~pfsc_drake.control.estimation.generalized_momentum.drive_momentum`
    it finds the friction of the drives, with those of ``link_momentum`` the external torques.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        drive_torque (input): What the drives are told until the next tick, within their limits
            [Nm or N], shape (N,).
        known_torque (input, optional): What else is known to act, see :class:`MomentumModel`,
            shape (N,); zero if not connected.
        estimate (output): The torque and its derivatives by rows, shape
            ((num_derivatives + 1) N,) [Nm or N, per s, ..]. It depends on the state and on
            ``joint_state`` alone, so that what drives the joints may depend on it.

    State:
        Discrete: the observer's memory.

    Args:
        observer: The observer.
        period: Its sampling time [s].
    """

    def __init__(self, observer: MomentumObserver, period: float) -> None:
        super().__init__()
        self._observer, n = observer, observer.num_joints
        memory = self.DeclareDiscreteState(observer.memory_size)
        self._joint_state = self.DeclareVectorInputPort("joint_state", 4 * n)
        self._drive_torque = self.DeclareVectorInputPort("drive_torque", n)
        self._known_torque = self.DeclareVectorInputPort("known_torque", n)
        self.DeclareVectorOutputPort(
            "estimate",
            observer.num_values,
            self._calc_estimate,
            prerequisites_of_calc={
                self._joint_state.ticket(),
                self.discrete_state_ticket(memory),
            },
        )
        self.DeclareInitializationDiscreteUpdateEvent(self._forget)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _calc_estimate(self, context: Context, output: BasicVector) -> None:
        memory = context.get_discrete_state_vector().value()
        output.SetFromVector(self._observer.estimate(memory, self._joint_state.Eval(context)))

    def _forget(self, context: Context, state: DiscreteValues) -> EventStatus:
        state.get_mutable_value()[:] = 0.0
        return EventStatus.Succeeded()

    def _update(self, context: Context, state: DiscreteValues) -> None:
        known = None
        if self._known_torque.HasValue(context):
            known = self._known_torque.Eval(context)
        self._observer.remember(
            state.get_mutable_value(),
            self._joint_state.Eval(context),
            self._drive_torque.Eval(context),
            known,
        )
