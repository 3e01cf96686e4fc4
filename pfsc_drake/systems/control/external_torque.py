"""External joint torques, and how they change, from the wrench on the tool and more."""

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, EventStatus, LeafSystem

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.control.compliance.tool_load import joint_torque_function
from pfsc_drake.control.estimation.signal_derivatives import SignalDerivatives
from pfsc_drake.robot.robot_model import RobotModel


class ExternalTorque(LeafSystem):
    """``tau_ext = J_g(q_J)^T wrench + link_torque`` (2.11), with derivatives as a law asks for.

    A law of relative degree r counts on ``tau_ext`` up to the derivative r - 2. A sensor
    gives none; they are estimated from the samples (:class:`SignalDerivatives`). Without an
    estimator the torque is passed on as it is and its derivatives are zero.

    Ports:
        wrench (input): ``[force, torque]`` on the tool at the tool point, world axes,
            shape (6,) [N, Nm]; zero if not connected.
        link_torque (input): What acts elsewhere on the robot means in the joints, shape (N,)
            [Nm or N]; zero if not connected.
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        tau_ext (output): Derivatives 0..num_derivatives by rows, shape
            ((num_derivatives + 1) N,) [Nm or N, per s, per s^2].

    State:
        Discrete: the estimator's, shape ((num_derivatives + 1) N,), and whether it has
        started, shape (1,). A torque that is not finite comes out as it is and leaves the
        state alone.

    Args:
        robot: The robot.
        num_derivatives: Of the output, r - 2.
        period: Sampling time [s].
        bandwidth: Of the estimator [rad/s]; 0 for none.

    Raises:
        InputError: If number of derivatives or bandwidth are out of range.
    """

    def __init__(
        self, robot: RobotModel, num_derivatives: int, period: float, bandwidth: float = 0.0
    ) -> None:
        super().__init__()
        n, self._rows = robot.dimension, num_derivatives + 1
        function = BoundFunction(joint_torque_function(robot))
        self._q, self._argument = function.arguments["q"], function.arguments["wrench"]
        self._tau, self._evaluate = function.results["tau_ext"], function.evaluate
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self._joint_state = self.DeclareVectorInputPort("joint_state", 4 * n)
        self._link_torque = self.DeclareVectorInputPort("link_torque", n)
        inputs = (self._wrench, self._joint_state, self._link_torque)
        sources = {port.ticket() for port in inputs}
        self._estimator = None
        if bandwidth != 0.0:
            self._estimator = SignalDerivatives(num_derivatives, bandwidth, period)
            memory = self.DeclareDiscreteState(self._rows * n + 1)
            sources.add(self.discrete_state_ticket(memory))
            self.DeclareInitializationDiscreteUpdateEvent(self._forget)
            self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        self._output = self.DeclareVectorOutputPort(
            "tau_ext", self._rows * n, self._calc_tau_ext, prerequisites_of_calc=sources
        )

    def _calc_tau_ext(self, context: Context, output: BasicVector) -> None:
        self._q[:] = self._joint_state.Eval(context)[: len(self._q)]
        self._argument[:] = self._wrench.Eval(context) if self._wrench.HasValue(context) else 0.0
        self._evaluate()
        if self._link_torque.HasValue(context):
            self._tau += self._link_torque.Eval(context)
        if self._estimator is None:
            result = np.zeros((self._rows, len(self._q)))
            result[0] = self._tau
        else:
            memory = context.get_discrete_state_vector().value()
            known = memory[-1] > 0.0
            state = memory[:-1].reshape(self._rows, -1)
            result = self._estimator.estimate(
                state if known else self._estimator.start(self._tau), self._tau
            )
        output.SetFromVector(result.ravel())

    def _forget(self, context: Context, state: DiscreteValues) -> EventStatus:
        state.get_mutable_value()[:] = 0.0
        return EventStatus.Succeeded()

    def _update(self, context: Context, state: DiscreteValues) -> None:
        estimate = self._output.Eval(context)
        if self._estimator is None or not np.isfinite(estimate).all():
            return
        memory = state.get_mutable_value()
        memory[:-1] = self._estimator.predict(estimate.reshape(self._rows, -1)).ravel()
        memory[-1] = 1.0
