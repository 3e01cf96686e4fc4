"""Messages of drake-franka-driver and drake-iiwa-driver, in the units and signs of this package."""

import enum
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from drake import (
    lcmt_force_torque,
    lcmt_iiwa_command,
    lcmt_iiwa_status,
    lcmt_panda_command,
    lcmt_panda_status,
)

from pfsc_drake.errors import InputError, suggestion


class ControlMode(enum.IntFlag):
    """Kind of a robot's commands, numbered as in drake-franka-driver."""

    NONE = 0
    POSITION = 1
    VELOCITY = 2
    TORQUE = 4


class RobotMode(enum.IntEnum):
    """Mode of a robot, numbered as in libfranka; only MOVE accepts commands."""

    OTHER = 0
    IDLE = 1
    MOVE = 2
    GUIDING = 3
    REFLEX = 4
    USER_STOPPED = 5
    AUTOMATIC_ERROR_RECOVERY = 6


@dataclass(frozen=True)
class RobotStatus:
    """Status of a robot at one of its ticks.

    Attributes:
        utime: Clock of the robot [us].
        q: Measured positions [rad or m], shape (N,).
        v: Measured velocities [rad/s or m/s], shape (N,).
        torque: Measured torques of the joints, including gravity [Nm or N], shape (N,).
        robot_mode: Mode of the robot.
        control_mode: Kind of its commands.
    """

    utime: int
    q: np.ndarray
    v: np.ndarray
    torque: np.ndarray
    robot_mode: RobotMode = RobotMode.MOVE
    control_mode: ControlMode = ControlMode.TORQUE


@dataclass(frozen=True)
class RobotCommand:
    """Command of a robot.

    Attributes:
        utime: The ``utime`` of the status that it answers [us], so that its age covers the whole
            round trip, independent of the controller's clock.
        mode: Kind of ``values``.
        values: Torques on top of the robot's own gravity compensation [Nm or N], velocities
            [rad/s or m/s] or positions [rad or m], shape (N,).
    """

    utime: int
    mode: ControlMode
    values: np.ndarray


class Dialect(ABC):
    """Messages of one kind of driver.

    Attributes:
        name: Name of the kind.
        status_channel: LCM channel of the robot's status.
        command_channel: LCM channel of its commands.
        modes: Supported control modes.
        expiry: Age from which a command is ignored [s].
    """

    name: str
    status_channel: str
    command_channel: str
    modes: ControlMode
    expiry: float

    @abstractmethod
    def encode_status(self, status: RobotStatus) -> bytes:
        """Return a status as a message."""

    @abstractmethod
    def decode_status(self, data: bytes) -> RobotStatus:
        """Return the status in a message.

        Raises:
            ValueError: If it is not a status.
        """

    @abstractmethod
    def encode_command(self, command: RobotCommand) -> bytes:
        """Return a command as a message."""

    @abstractmethod
    def decode_command(self, data: bytes) -> RobotCommand:
        """Return the command in a message.

        Raises:
            ValueError: If it is not a command.
        """


class PandaDialect(Dialect):
    """drake-franka-driver: torques, velocities or positions of any number of joints."""

    name = "panda"
    status_channel, command_channel = "PANDA_STATUS", "PANDA_COMMAND"
    modes = ControlMode.POSITION | ControlMode.VELOCITY | ControlMode.TORQUE
    expiry = 0.1

    def encode_status(self, status: RobotStatus) -> bytes:
        """Return a status as a message."""
        message, n = lcmt_panda_status(), len(status.q)
        zeros = [0.0] * n
        message.utime = message.robot_utime = status.utime
        message.num_joints = n
        message.joint_position = status.q.tolist()
        message.joint_velocity = status.v.tolist()
        message.joint_torque = status.torque.tolist()
        message.joint_position_desired = message.joint_position
        message.joint_velocity_desired = message.joint_velocity
        message.joint_acceleration_desired = zeros
        message.joint_torque_desired = message.joint_torque_external = zeros
        message.control_command_success_rate = 1.0
        message.robot_mode = int(status.robot_mode)
        message.control_mode = int(status.control_mode)
        encoded: bytes = message.encode()
        return encoded

    def decode_status(self, data: bytes) -> RobotStatus:
        """Return the status in a message."""
        message = lcmt_panda_status.decode(data)
        return RobotStatus(
            message.utime,
            np.array(message.joint_position),
            np.array(message.joint_velocity),
            np.array(message.joint_torque),
            RobotMode(message.robot_mode),
            ControlMode(message.control_mode),
        )

    def encode_command(self, command: RobotCommand) -> bytes:
        """Return a command as a message."""
        message, values = lcmt_panda_command(), command.values.tolist()
        message.utime, message.control_mode_expected = command.utime, int(command.mode)
        for mode, name in _PANDA_FIELDS.items():
            field_values = values if mode == command.mode else []
            setattr(message, f"num_{name}", len(field_values))
            setattr(message, name, field_values)
        encoded: bytes = message.encode()
        return encoded

    def decode_command(self, data: bytes) -> RobotCommand:
        """Return the command in a message."""
        message = lcmt_panda_command.decode(data)
        mode = ControlMode(message.control_mode_expected)
        if mode not in _PANDA_FIELDS:
            raise ValueError(f"control_mode_expected = {mode:d}")
        return RobotCommand(message.utime, mode, np.array(getattr(message, _PANDA_FIELDS[mode])))


_PANDA_FIELDS = {
    ControlMode.POSITION: "joint_position",
    ControlMode.VELOCITY: "joint_velocity",
    ControlMode.TORQUE: "joint_torque",
}


class IiwaDialect(Dialect):
    """drake-iiwa-driver with ``--torque_only``.

    In a status, measured and commanded torques have the opposite sign of the one used here; in a
    command they do not.
    """

    name = "iiwa"
    status_channel, command_channel = "IIWA_STATUS", "IIWA_COMMAND"
    modes = ControlMode.TORQUE
    expiry = 0.05

    def encode_status(self, status: RobotStatus) -> bytes:
        """Return a status as a message."""
        message, n = lcmt_iiwa_status(), len(status.q)
        message.utime, message.num_joints = status.utime, n
        message.joint_position_measured = status.q.tolist()
        message.joint_velocity_estimated = status.v.tolist()
        message.joint_position_commanded = message.joint_position_ipo = status.q.tolist()
        message.joint_torque_measured = (-status.torque).tolist()
        message.joint_torque_commanded = message.joint_torque_external = [0.0] * n
        encoded: bytes = message.encode()
        return encoded

    def decode_status(self, data: bytes) -> RobotStatus:
        """Return the status in a message, which contains no modes."""
        message = lcmt_iiwa_status.decode(data)
        return RobotStatus(
            message.utime,
            np.array(message.joint_position_measured),
            np.array(message.joint_velocity_estimated),
            -np.array(message.joint_torque_measured),
        )

    def encode_command(self, command: RobotCommand) -> bytes:
        """Return a command as a message; the driver ignores the positions."""
        message, n = lcmt_iiwa_command(), len(command.values)
        message.utime, message.num_joints, message.num_torques = command.utime, n, n
        message.joint_position = [0.0] * n
        message.joint_torque = command.values.tolist()
        encoded: bytes = message.encode()
        return encoded

    def decode_command(self, data: bytes) -> RobotCommand:
        """Return the command in a message."""
        message = lcmt_iiwa_command.decode(data)
        return RobotCommand(message.utime, ControlMode.TORQUE, np.array(message.joint_torque))


_DIALECTS = {dialect.name: dialect for dialect in (PandaDialect, IiwaDialect)}
FORCE_TORQUE_CHANNEL = "FORCE_TORQUE"


def dialect(name: str) -> Dialect:
    """Return the messages of a kind of driver.

    Args:
        name: Name of the kind, ``panda`` or ``iiwa``.

    Raises:
        InputError: If there is no such kind.
    """
    if name not in _DIALECTS:
        allowed = f"{', '.join(_DIALECTS)}{suggestion(name, _DIALECTS)}"
        raise InputError(f"driver {name}: allowed: {allowed}")
    return _DIALECTS[name]()


def encode_wrench(utime: int, wrench: np.ndarray) -> bytes:
    """Return a measurement of a force sensor as a message.

    Args:
        utime: Clock of the robot [us].
        wrench: Force and torque on the sensor, its axes, shape (6,) [N, Nm].
    """
    message = lcmt_force_torque()
    message.timestamp = utime
    message.fx, message.fy, message.fz, message.tx, message.ty, message.tz = wrench.tolist()
    encoded: bytes = message.encode()
    return encoded


def decode_wrench(data: bytes) -> np.ndarray:
    """Return the measurement of a force sensor, shape (6,) [N, Nm].

    Args:
        data: The message.

    Raises:
        ValueError: If it is not such a message.
    """
    m = lcmt_force_torque.decode(data)
    return np.array([m.fx, m.fy, m.fz, m.tx, m.ty, m.tz])
