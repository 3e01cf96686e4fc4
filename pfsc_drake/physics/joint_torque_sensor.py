"""Torque sensors in elastic joints."""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.checks import require_between, require_not_negative
from pfsc_drake.physics.force_torque_sensor import NOISE_TICKS, noise_at
from pfsc_drake.robot.robot_model import RobotModel


@dataclass
class TorqueSensorOptions:
    """What joint torque sensors do to the true torques.

    Attributes:
        scale: Relative error of their scale.
        noise: Standard deviation of the white noise of a sample, as a share of the joint's largest
            torque.
        seed: Seed of the noise.
    """

    scale: float = 0.0
    noise: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        require_between("scale", self.scale, -0.5, 0.5, "")
        require_not_negative("noise", self.noise)


class JointTorqueSensor(Block):
    """Measures the torques of springs and dampers of elastic joints, without delay.

    Ports:
        joint_state (input): True ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        noise (input, optional): n of NOISE_TICKS ticks, one tick after the other.
        joint_torque (output): ``(1 + scale) tau_J + n``, zero of rigid joints, shape (N,).

    Args:
        robot: The robot as it is, N joints.
        options: What the sensors do.
    """

    expands = False  # noise is looked up

    def __init__(self, robot: RobotModel, options: TorqueSensorOptions) -> None:
        n = robot.dimension
        self._n, self._factor = n, 1.0 + options.scale
        elastic = robot.elastic_joints
        self._stiffness = ca.DM(np.where(elastic, robot.K_s, 0.0))
        self._damping = ca.DM(np.where(elastic, robot.K_d, 0.0))
        self.inputs = {
            "joint_state": Port(4 * n, "rad, rad/s or m, m/s"),
            "noise": Port(n * NOISE_TICKS, "Nm or N", optional=True),
        }
        self.outputs, self.states = {"joint_torque": Port(n, "Nm or N")}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        q_J, v_J, q_M, v_M = ca.vertsplit(u.joint_state, self._n)
        torque = self._factor * (self._stiffness * (q_M - q_J) + self._damping * (v_M - v_J))
        return {"joint_torque": torque + noise_at(u.noise, self._n, t)}
