"""Standard deviations of link positions that are estimated from motors and torques."""

from dataclasses import dataclass
from typing import Annotated, Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.estimation.momentum import SMOOTH
from pfsc_drake.robot.robot_model import RobotModel, pose_function
from pfsc_drake.yaml.rules import NotNegative, Parameters, Range


@dataclass
class StateUncertainty(Parameters):
    """Uncertainty of the data from which the links' side of elastic joints is estimated.

    All are standard deviations. Errors of different joints and of different kinds are uncorrelated.

    Attributes:
        stiffness: Stiffness of a joint, as a share of it.
        torque_scale: Relative error of the scale of torque sensors.
        torque_noise: Noise of a sample of torque sensors, as a share of the joint's largest torque.
        friction: Modelled friction, as a share of it.
        coulomb: Unmodelled Coulomb friction, as a share of the joint's largest torque.
        viscous: Unmodelled viscous friction, as a share of the largest torque at the largest speed.
    """

    stiffness: Annotated[float, Range(0.0, 0.5)] = 0.05
    torque_scale: Annotated[float, Range(0.0, 0.5)] = 0.01
    torque_noise: NotNegative = 0.001
    friction: NotNegative = 0.2
    coulomb: NotNegative = 0.05
    viscous: NotNegative = 0.05


@dataclass(frozen=True)
class LinkErrors:
    """Standard deviations of the data for the links' side of N joints; see the block.

    Attributes:
        noise: Noise of estimated positions and velocities, shape (2, N) [rad, rad/s or m, m/s].
        share: Relative error of a deflection.
        lag: Delay of estimated torques [s].
        coulomb: Coulomb friction while a joint moves, shape (N,) [Nm or N].
        stuck: Largest static friction, shape (N,) [Nm or N].
        viscous: Viscous friction, shape (N,) [Nm s/rad or N s/m].
    """

    noise: np.ndarray
    share: float
    lag: float
    coulomb: np.ndarray
    stuck: np.ndarray
    viscous: np.ndarray

    @property
    def has_torque_sensors(self) -> bool:
        """Whether torques are measured, not observed."""
        return self.lag == 0.0


class LinkDeviation(Block):
    """Computes standard deviations of the links' positions and velocities, and of the tool point.

    The estimate of :class:`LinkState` contains uncorrelated errors. With the estimated deflection
    ``d = q_M - q_J`` of a joint::

        sigma_q^2 = noise^2 + (share d)^2 + (lag d')^2 + (sigma_f / K_s)^2
        sigma_v^2 = noise_v^2 + (share d')^2                 of torques that are measured
        sigma_f^2 = (f_c tanh(v_M / w))^2 + (f_v v_M)^2 + (f_s / cosh^2(v_M / w))^2 / 3
        sigma_y^2 = sum over the joints of (dy/dq_J sigma_q)^2

    With measured torques ``share`` contains the errors of stiffness and of torque scale. Observed
    torques are delayed by the ``lag``, and unmodelled friction is taken for a torque of the spring:
    the error of the friction model while a joint moves, and at rest a torque that is uniformly
    distributed up to the largest static friction, whence the 3. The resulting velocity error varies
    with reversals; with observed torques there is no velocity deviation. An error of known
    size, such as the lag, is treated as a deviation.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]`` from :class:`LinkState`, shape (4N,).
        position_deviation (output): sigma_q, shape (N,) [rad or m].
        velocity_deviation (output): sigma_v where torques are measured, shape (N,)
            [rad/s or m/s].
        tool_deviation (output): sigma_y along the axes of the world, shape (3,) [m].

    Args:
        robot: Nominal model of the robot, N joints.
        errors: Standard deviations of its data.
    """

    def __init__(self, robot: RobotModel, errors: LinkErrors) -> None:
        n = robot.dimension
        self._n, self._errors = n, errors
        elastic = robot.elastic_joints
        self._compliance = ca.DM(np.where(elastic, 1.0 / robot.K_s, 0.0))
        self._jacobian = _tool_jacobian(robot)
        self.inputs = {"joint_state": Port(4 * n, "rad, rad/s or m, m/s")}
        self.outputs = {"position_deviation": Port(n, "rad or m"), "tool_deviation": Port(3, "m")}
        if errors.has_torque_sensors:
            self.outputs["velocity_deviation"] = Port(n, "rad/s or m/s")
        self.states = {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        errors = self._errors
        q_J, v_J, q_M, v_M = ca.vertsplit(u.joint_state, self._n)
        noise_q, noise_v = (ca.DM(noise) for noise in errors.noise)
        squares = noise_q**2 + (errors.share * (q_M - q_J)) ** 2
        if not errors.has_torque_sensors:
            slip = ca.tanh(v_M / SMOOTH)
            friction = (ca.DM(errors.coulomb) * slip) ** 2 + (ca.DM(errors.viscous) * v_M) ** 2
            static_friction = ca.DM(errors.stuck) * (1.0 - slip**2)
            squares += (errors.lag * (v_M - v_J)) ** 2
            squares += self._compliance**2 * (friction + static_friction**2 / 3.0)
        found = {
            "position_deviation": ca.sqrt(squares),
            "tool_deviation": ca.sqrt(self._jacobian(q_J) ** 2 @ squares),
        }
        if errors.has_torque_sensors:
            found["velocity_deviation"] = ca.sqrt(noise_v**2 + (errors.share * (v_M - v_J)) ** 2)
        return found


@once_per_content()
def _tool_jacobian(robot: RobotModel) -> ca.Function:
    """Return ``q_J -> dy_t / dq_J``, shapes (N,) and (3, N)."""
    q = ca.SX.sym("q", robot.dimension)
    y_t = pose_function(robot)(q)[:3]
    return ca.Function("tool_jacobian", [q], [ca.cse(ca.densify(ca.jacobian(y_t, q)))])
