"""What systems that estimate torques from the joints' motion share."""

from pydrake.systems.framework import Context, DiscreteValues, EventStatus, LeafSystem

from pfsc_drake.control.estimation.sampled_estimator import SampledEstimator


class EstimatorSystem(LeafSystem):
    """Inputs, memory and updates of an estimator; what it tells is declared by who derives.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        drive_torque (input): What the drives are told until the next tick, within their limits
            [Nm or N], shape (N,).
        known_torque (input, optional): What else is known to act, see
            :class:`~pfsc_drake.control.estimation.generalized_momentum.MomentumModel`, shape
            (N,); zero if not connected.

    State:
        Discrete: the estimator's memory.

    Args:
        estimator: The estimator.
        period: Its sampling time [s].
    """

    def __init__(self, estimator: SampledEstimator, period: float) -> None:
        super().__init__()
        self._start_memory, self._remember = estimator.initial_memory, estimator.remember
        n = estimator.num_joints
        memory = self.DeclareDiscreteState(estimator.initial_memory)
        self._joint_state = self.DeclareVectorInputPort("joint_state", 4 * n)
        self._drive_torque = self.DeclareVectorInputPort("drive_torque", n)
        self._known_torque = self.DeclareVectorInputPort("known_torque", n)
        # without the drives' torque, so that it may depend on the estimate
        self._sources = {self._joint_state.ticket(), self.discrete_state_ticket(memory)}
        self.DeclareInitializationDiscreteUpdateEvent(self._start)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _start(self, context: Context, state: DiscreteValues) -> EventStatus:
        state.get_mutable_value()[:] = self._start_memory
        return EventStatus.Succeeded()

    def _update(self, context: Context, state: DiscreteValues) -> None:
        known = None
        if self._known_torque.HasValue(context):
            known = self._known_torque.Eval(context)
        self._remember(
            state.get_mutable_value(),
            self._joint_state.Eval(context),
            self._drive_torque.Eval(context),
            known,
        )
