"""The links' side of elastic joints, of which only the motors' side and a torque are measured."""

from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.control.estimation.filters import SignalDerivatives
from pfsc_drake.robot.robot_model import RobotModel

# a torque that changes as a parabola is followed without lag
_DEGREE = 2


class LinkState(Block):
    """Finds positions and velocities of links from motors and the torques of their springs.

    With ``tau_J = K_s (q_M - q_J) + K_d (v_M - v_J)`` and the derivative of the torque from a
    fading-memory polynomial filter (:class:`SignalDerivatives`)::

        v_J = v_M - tau_J' / K_s,    q_J = q_M - (tau_J - K_d (v_M - v_J)) / K_s

    where the damping's share of ``tau_J'`` is neglected. Rigid joints have one side.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, of elastic joints the motors' side alone is
            read, shape (4N,).
        joint_torque (input): Torques of the springs and dampers, shape (N,) [Nm or N].
        joint_state (output): The same with the links' side found, shape (4N,).

    State:
        The filter's ``prediction`` of the torques and their derivatives.

    Args:
        robot: The robot as it is believed, N joints.
        bandwidth: Rate at which the filter forgets [rad/s].
        period: Sampling time [s].

    Raises:
        InputError: If the bandwidth is out of range.
    """

    def __init__(self, robot: RobotModel, bandwidth: float, period: float) -> None:
        n = robot.dimension
        self._n, self._filter = n, SignalDerivatives(_DEGREE, bandwidth, period)
        elastic = robot.elastic_joints
        self._compliance = ca.DM(np.where(elastic, 1.0 / robot.K_s, 0.0))
        self._damping = ca.DM(np.where(elastic, robot.K_d, 0.0))
        self.inputs = {
            "joint_state": Port(4 * n, "rad, rad/s or m, m/s"),
            "joint_torque": Port(n, "Nm or N"),
        }
        self.outputs = {"joint_state": Port(4 * n, "rad, rad/s or m, m/s")}
        self.inner = {"estimate": (_DEGREE + 1) * n}
        self.states = {"prediction": (_DEGREE + 1) * n}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the start; what is left out is zero."""
        return {"prediction": self._filter.start(u.joint_torque)}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        _, _, q_M, v_M = ca.vertsplit(u.joint_state, self._n)
        estimate = self._filter.estimate(x.prediction, u.joint_torque)
        deflection_rate = self._compliance * estimate[self._n : 2 * self._n]
        spring = u.joint_torque - self._damping * deflection_rate
        q_J, v_J = q_M - self._compliance * spring, v_M - deflection_rate
        return {"joint_state": ca.vertcat(q_J, v_J, q_M, v_M), "estimate": estimate}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the next tick; what is left out stays."""
        return {"prediction": self._filter.predict(y.estimate)}
