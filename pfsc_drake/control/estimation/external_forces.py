"""External forces: joint torques of a wrench on the tool, and the inverse."""

from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, where
from pfsc_drake.control.estimation.filters import SignalDerivatives
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.tool_load import dead_band, joint_torque_function


class ExternalTorque(Block):
    """``tau_ext = J_g(q_J)^T wrench + link_torque`` (2.11), with the derivatives that a law needs.

    A law of relative degree r needs ``tau_ext`` up to the derivative r - 2. A sensor measures no
    derivatives; they are estimated from the samples (:class:`SignalDerivatives`), as if the first
    sample had always been present. Without an estimator the torque is passed through unchanged and
    its derivatives are zero.

    Ports:
        wrench (input, optional): ``[force, torque]`` on the tool at the tool point, world axes,
            shape (6,) [N, Nm]; zero if not connected.
        link_torque (input, optional): Joint torques of the forces that act elsewhere on the robot,
            shape (N,) [Nm or N]; zero if not connected.
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        tau_ext (output): Derivatives 0..num_derivatives by rows, shape
            ((num_derivatives + 1) N,) [Nm or N, per s, per s^2].

    State:
        With an estimator its prediction for this tick (``predicted``), and whether there was a
        sample (``seen``). A NaN or infinite torque passes through and changes neither.

    Args:
        robot: The robot.
        num_derivatives: Number of derivatives of the output, r - 2.
        period: Sampling time [s].
        bandwidth: Bandwidth of the estimator [rad/s]; 0 for none.

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
        """Return all outputs, and the inner values."""
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
        """Return the states at the next tick; omitted ones keep their values."""
        if self._estimator is None:
            return {}
        good, predicted = all_finite(y.tau_ext), self._estimator.predict(y.tau_ext)
        return {
            "predicted": where(good, predicted, x.predicted),
            "seen": where(good, 1.0, x.seen),
        }


_POSITION_ONLY = 3


class ToolWrench(Block):
    """Estimates the wrench on the tool from torques in the joints, the inverse of (2.11).

    ``wrench = (J J^T + damping^2 I)^-1 J tau_ext`` of ``tau_ext = J_g^T wrench``: without damping
    the inverse, or with more joints than components the least-squares fit. With damping, components
    that a singular posture does not determine tend to zero instead of growing without bound. Arms
    with three joints determine a force only; the torque is assumed to be zero. Both parts are
    reduced by a dead band. NaN and infinite values pass through.

    Ports:
        tau_ext (input): External torques in the joints [Nm or N], shape (N,).
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        wrench (output): ``[force, torque]`` on the tool at the tool point, world axes, shape
            (6,) [N, Nm].

    Args:
        robot: The robot, N joints, three or at least six.
        damping: Damping of the inverse, beside the singular values of J in m and rad.
        dead_bands: Widths for force [N] and torque [Nm].

    Raises:
        InputError: If a number is out of range, or the robot has too few joints.
    """

    def __init__(
        self, robot: RobotModel, damping: float = 0.0, dead_bands: tuple[float, float] = (0.0, 0.0)
    ) -> None:
        n = robot.dimension
        if n != _POSITION_ONLY and n < 6:
            raise InputError(
                f"forces on the tool from the torques in {n} joints: not determined; needs 3 "
                "joints for a force, 6 or more for force and torque"
            )
        for name, value in (("damping", damping), ("dead bands", min(dead_bands))):
            if not 0.0 <= value < np.inf:
                raise InputError(f"{name} = {value}: must be zero or positive")
        self._n, self._size = n, 3 if n == _POSITION_ONLY else 6
        self._damping, self._dead_bands = damping, dead_bands
        self._fit = self._fit_function(robot)
        self.inputs = {
            "tau_ext": Port(n, "Nm or N"),
            "joint_state": Port(4 * n, "rad, rad/s or m, m/s"),
        }
        self.outputs, self.states = {"wrench": Port(6, "N, Nm")}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        found = self._fit(u.joint_state[: self._n], u.tau_ext)
        force, torque = (
            dead_band(part, width)
            for part, width in zip(ca.vertsplit(found, 3), self._dead_bands, strict=True)
        )
        return {"wrench": ca.vertcat(force, torque)}

    def _fit_function(self, robot: RobotModel) -> ca.Function:
        """Return ``(q, tau_ext) -> wrench`` without dead bands."""
        q, tau, wrench = ca.SX.sym("q", self._n), ca.SX.sym("tau", self._n), ca.SX.sym("wrench", 6)
        J = ca.jacobian(joint_torque_function(robot)(q, wrench), wrench)[:, : self._size].T
        square = J @ J.T + self._damping**2 * ca.SX.eye(self._size)
        found = ca.ldl_solve(J @ tau, *ca.ldl(square))
        found = ca.densify(ca.vertcat(found, ca.SX(6 - self._size, 1)))
        return ca.Function("tool_wrench", [q, tau], [found])
