"""External joint torques, and how they change, from the wrench on the tool and more."""

from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, where
from pfsc_drake.control.estimation.signal_derivatives import SignalDerivatives
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.tool_load import joint_torque_function


class ExternalTorque(Block):
    """``tau_ext = J_g(q_J)^T wrench + link_torque`` (2.11), with derivatives as a law asks for.

    A law of relative degree r counts on ``tau_ext`` up to the derivative r - 2. A sensor
    gives none; they are estimated from the samples (:class:`SignalDerivatives`), as if the first
    had been there for ever. Without an estimator the torque is passed on as it is and its
    derivatives are zero.

    Ports:
        wrench (input, optional): ``[force, torque]`` on the tool at the tool point, world axes,
            shape (6,) [N, Nm]; zero if not connected.
        link_torque (input, optional): What acts elsewhere on the robot means in the joints, shape
            (N,) [Nm or N]; zero if not connected.
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        tau_ext (output): Derivatives 0..num_derivatives by rows, shape
            ((num_derivatives + 1) N,) [Nm or N, per s, per s^2].

    State:
        With an estimator what it predicts for this tick (``predicted``), and whether there was a
        sample (``seen``). A torque that is not finite comes out as it is and leaves both alone.

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
        n, values = robot.dimension, (num_derivatives + 1) * robot.dimension
        self._n, self._torque = n, joint_torque_function(robot)
        self.inputs = {
            "wrench": Port(6, "N, Nm", optional=True),
            "joint_state": Port(4 * n, "rad, rad/s or m, m/s"),
            "link_torque": Port(n, "Nm or N", optional=True),
        }
        self.outputs, self.states = {"tau_ext": Port(values, "Nm or N, per s, per s^2")}, {}
        self._estimator = None
        if bandwidth != 0.0:
            self._estimator = SignalDerivatives(num_derivatives, bandwidth, period)
            self.states = {"predicted": values, "seen": 1}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        wrench = ca.DM.zeros(6) if u.wrench is None else u.wrench
        tau = self._torque(u.joint_state[: self._n], wrench)
        if u.link_torque is not None:
            tau += u.link_torque
        if self._estimator is None:
            rest = self.outputs["tau_ext"].size - self._n
            return {"tau_ext": ca.vertcat(tau, ca.DM.zeros(rest))}
        predicted = where(x.seen > 0.0, x.predicted, self._estimator.start(tau))
        return {"tau_ext": self._estimator.estimate(predicted, tau)}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        if self._estimator is None:
            return {}
        good, predicted = all_finite(y.tau_ext), self._estimator.predict(y.tau_ext)
        return {
            "predicted": where(good, predicted, x.predicted),
            "seen": where(good, 1.0, x.seen),
        }
