"""The links' side of elastic joints, of which only the motors' side and a torque are measured."""

from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.control.estimation.filters import SignalDerivatives
from pfsc_drake.robot.robot_model import MAY_BE_PARAMETRIC, RobotModel, link_acceleration

# an acceleration that the model does not know is followed without lag while it stays
_DEGREE = 2


class LinkState(Block):
    """Finds positions and velocities of links from motors and the torques of their springs.

    A torque ``tau_J = K_s (q_M - q_J) + K_d (v_M - v_J)`` tells where a link is, and by (2.65a) how
    it is accelerated. So its velocity is no derivative of what is measured: a fading-memory
    polynomial filter (:class:`SignalDerivatives`) follows position, velocity and what acceleration
    the model does not know, of forces from outside and of wrong masses::

        q_J = q_M - (tau_J - K_d (v_M - v_J)) / K_s            what it is corrected by
        q_J'' = D_E^-1(q_J) (tau_J - n_E(q_J, v_J)) + unknown  what it expects

    with the spring's torque of the middle of the coming interval,
    ``tau_J + K_s (v_M - v_J) T / 2``. Rigid joints have one side.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, of elastic joints the motors' side alone is
            read, shape (4N,).
        joint_torque (input): Torques of the springs and dampers, shape (N,) [Nm or N].
        joint_state (output): The same with the links' side found, shape (4N,).

    State:
        The filter's ``prediction`` of positions, velocities and unknown accelerations.

    Args:
        robot: The robot as it is believed, N joints.
        bandwidth: Rate at which the filter forgets [rad/s].
        period: Sampling time [s].

    Raises:
        InputError: If the bandwidth is out of range.
    """

    def __init__(self, robot: RobotModel, bandwidth: float, period: float) -> None:
        n, elastic = robot.dimension, robot.elastic_joints
        self._n, self._period = n, period
        self._filter = SignalDerivatives(_DEGREE, bandwidth, period)
        self._acceleration = link_acceleration(robot)
        self._elastic = ca.DM(elastic.astype(float))
        self._damping = ca.DM(np.where(elastic, robot.K_d, 0.0))
        self._springs = ca.Function("springs", [], [robot.springs], MAY_BE_PARAMETRIC)
        self.inputs = {
            "joint_state": Port(4 * n, "rad, rad/s or m, m/s"),
            "joint_torque": Port(n, "Nm or N"),
        }
        self.outputs = {"joint_state": Port(4 * n, "rad, rad/s or m, m/s")}
        self.inner = {"estimate": (_DEGREE + 1) * n}
        self.states = {"prediction": (_DEGREE + 1) * n}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the start; what is left out is zero."""
        _, _, q_M, _ = ca.vertsplit(u.joint_state, self._n)
        return {"prediction": self._filter.start(q_M - self._deflection(u.joint_torque))}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        n = self._n
        _, _, q_M, v_M = ca.vertsplit(u.joint_state, n)
        spring = u.joint_torque - self._damping * (v_M - x.prediction[n : 2 * n])
        sample = q_M - self._deflection(spring)
        estimate = self._filter.estimate(x.prediction, sample)
        v_J = estimate[n : 2 * n]
        v_J = self._elastic * v_J + (1.0 - self._elastic) * v_M
        return {"joint_state": ca.vertcat(sample, v_J, q_M, v_M), "estimate": estimate}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the next tick; what is left out stays."""
        n, T = self._n, self._period
        q_J, v_J, _, v_M = ca.vertsplit(y.joint_state, n)
        torque = u.joint_torque + self._springs()["o0"] * (v_M - v_J) * (T / 2.0)
        a = self._acceleration(q_J, v_J, torque)
        known = ca.vertcat(a * (T**2 / 2.0), a * T, ca.DM.zeros(n))
        return {"prediction": self._filter.predict(y.estimate) + known}

    def _deflection(self, spring: Any) -> Any:
        """Return by how much springs are bent, zero in rigid joints."""
        stiffness = self._springs()["o0"] + (1.0 - self._elastic)
        return self._elastic * spring / stiffness
