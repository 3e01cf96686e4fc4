"""Sensors of joints: position encoders, and torque sensors of elastic joints."""

from dataclasses import dataclass, field
from typing import Annotated, Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import where
from pfsc_drake.errors import InputError
from pfsc_drake.physics.force_torque_sensor import NOISE_TICKS, noise_at
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.yaml.fields import ONE_OR_MANY
from pfsc_drake.yaml.rules import NotNegative, OneOf, Parameters, Range


@dataclass
class TorqueSensorOptions(Parameters):
    """Error model of joint torque sensors.

    Attributes:
        scale: Relative error of the scale.
        noise: Standard deviation of the white noise of a sample, as a share of the joint's largest
            torque.
        seed: Seed of the noise.
    """

    scale: Annotated[float, Range(-0.5, 0.5)] = 0.0
    noise: NotNegative = 0.0
    seed: int = 0


class JointTorqueSensor(Block):
    """Measures the torques of springs and dampers of elastic joints, without delay.

    Ports:
        joint_state (input): Actual ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        noise (input, optional): n of NOISE_TICKS consecutive ticks.
        joint_torque (output): ``(1 + scale) tau_J + n``, zero of rigid joints, shape (N,).

    Args:
        robot: The simulated robot, N joints.
        options: Error model of the sensors.
    """

    expands = False  # noise is a table

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


SIDES = ("both", "motor", "motor_and_torque")


@dataclass
class EncoderOptions(Parameters):
    """Encoder model: quantization and differentiation of joint positions.

    Increments are counted on the joint side: per revolution of a revolute joint, per metre
    of a slide. An encoder on the motor shaft has its own number times the gear ratio.

    Attributes:
        link_increments: Increments of the encoders of ``q_J``: none (exact), one number for
            all joints, or one per joint; 0 is exact.
        motor_increments: Increments of the encoders of ``q_M``, likewise.
        difference_quotient: Whether velocities are difference quotients of the measured
            positions, otherwise the actual ones.
        filter_time: Time constant of a first-order filter of the difference quotient
            [s]; 0 for none.
        sides: Measured sides of elastic joints: ``both``, ``motor``, or
            ``motor_and_torque``, the motors' side and the torques of the springs.
        torque: The torque sensors, if there are any.
    """

    link_increments: list[float] = field(default_factory=list, metadata=ONE_OR_MANY)
    motor_increments: list[float] = field(default_factory=list, metadata=ONE_OR_MANY)
    difference_quotient: bool = False
    filter_time: float = 0.0
    sides: Annotated[str, OneOf(SIDES)] = "both"
    torque: TorqueSensorOptions = field(default_factory=TorqueSensorOptions)


class JointEncoders(Block):
    """Measures the joint state by encoders, without delay.

    A position is ``r round(q / r)`` with the resolution ``r = 2 pi / increments`` [rad] or
    ``1 / increments`` [m]. With difference quotients the velocity is, at the ticks::

        v_k = v_{k-1} + (1 - exp(-T / filter_time)) ((q_k - q_{k-1}) / T - v_{k-1})

    (without a filter ``(q_k - q_{k-1}) / T``) and is constant in between; initially it is the
    actual velocity. At a tick the output is the value of this tick. Without any option
    the output equals the input to the last bit.

    Ports:
        joint_state (input): Actual ``[q_J, v_J, q_M, v_M]``, shape (4N,) [rad, rad/s or m, m/s].
        joint_state (output): Measured joint state, shape (4N,).

    State:
        With difference quotients only: ``measured`` state at the last ``tick``, and its number;
        initially the state at the start, which may be less than a period before the first tick.

    Args:
        robot: The robot, N joints.
        options: Encoder model.
        period: Sampling time T of the difference quotient [s], the shortest one of all readers.

    Raises:
        InputError: If an option or the period is out of range.
    """

    def __init__(self, robot: RobotModel, options: EncoderOptions, period: float) -> None:
        n = robot.dimension
        if not 0.0 < period < np.inf:
            raise InputError(f"encoders: period = {period!r} s; must be positive and finite")
        if not 0.0 <= options.filter_time < np.inf:
            raise InputError(
                f"encoders: filter_time = {options.filter_time!r} s; must be finite, not negative"
            )
        self._size, self._period, self._differs = n, period, options.difference_quotient
        self._resolution = encoder_resolution(robot, options)
        time_constant = options.filter_time
        self._weight = 1.0 - np.exp(-period / time_constant) if time_constant else 1.0
        self.inputs = {"joint_state": Port(4 * n, "rad, rad/s or m, m/s")}
        self.outputs = {"joint_state": Port(4 * n, "rad, rad/s or m, m/s")}
        self.states = {"measured": 4 * n, "tick": 1} if self._differs else {}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states; omitted ones are zero."""
        if not self._differs:
            return {}
        return {"measured": ca.vertcat(*self._quantize(u)), "tick": np.inf}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        q_J, v_J, q_M, v_M = self._quantize(u)
        if self._differs:
            before = ca.vertsplit(x.measured, self._size)
            v_J, v_M = (
                self._velocity(x, t, q_J, *before[:2]),
                self._velocity(x, t, q_M, *before[2:]),
            )
        return {"joint_state": ca.vertcat(q_J, v_J, q_M, v_M)}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        return {"measured": y.joint_state, "tick": t} if self._differs else {}

    def _velocity(self, x: Values, t: Any, q: Any, q_before: Any, v_before: Any) -> Any:
        quotient = (q - q_before) / self._period
        return where(t > x.tick + 0.5, v_before + self._weight * (quotient - v_before), v_before)

    def _quantize(self, u: Values) -> tuple[Any, Any, Any, Any]:
        """Return ``q_J`` and ``q_M`` in whole steps, with their velocities."""
        q_J, v_J, q_M, v_M = ca.vertsplit(u.joint_state, self._size)
        return (
            _round_to_steps(q_J, self._resolution[0]),
            v_J,
            _round_to_steps(q_M, self._resolution[1]),
            v_M,
        )


def _round_to_steps(q: Any, resolution: np.ndarray) -> Any:
    """Return the nearest multiples of steps, where these are not zero."""
    counted, steps = ca.DM(resolution > 0.0), ca.DM(np.where(resolution > 0.0, resolution, 1.0))
    number = q / steps
    # rounded half to even
    return where(counted, steps * (number - ca.remainder(number, 1.0)), q)


def encoder_resolution(robot: RobotModel, options: EncoderOptions) -> np.ndarray:
    """Return the steps of the measured positions of links and motors, shape (2, N) [rad or m].

    Args:
        robot: The robot, N joints.
        options: Encoder model.

    Raises:
        InputError: If an option is out of range.
    """
    n = robot.dimension
    per_unit, steps = np.where(robot.gather("is_revolute"), 2.0 * np.pi, 1.0), np.zeros((2, n))
    for step, name in zip(steps, ("link_increments", "motor_increments"), strict=True):
        increments = _increments(name, getattr(options, name), n)
        coarse = increments > 0.0
        step[coarse] = per_unit[coarse] / increments[coarse]
    return steps


def _increments(name: str, values: list[float], size: int) -> np.ndarray:
    array = np.array(values or [0.0], dtype=float)
    fits = array.ndim == 1 and array.size in (1, size)
    if not (fits and np.all((array >= 0.0) & np.isfinite(array))):
        raise InputError(
            f"encoders: {name} = {values}; must be none, one or {size} numbers, finite and "
            "not negative"
        )
    return np.broadcast_to(array, size)
