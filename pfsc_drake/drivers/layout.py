"""Byte layout and address of a robot's messages, for a controller in C."""

import ipaddress
import struct
from dataclasses import dataclass, replace
from urllib.parse import parse_qs, urlsplit

import numpy as np

from pfsc_drake.drivers.messages import (
    ControlMode,
    Dialect,
    RobotCommand,
    RobotMode,
    RobotStatus,
    encode_wrench,
)
from pfsc_drake.errors import InputError

# LCM's defaults
_ADDRESS, _PORT = "239.255.76.67", 7667
# every message begins with eight bytes for its type; the time follows
_TYPE = slice(0, 8)
_COUNT = 16  # offset of the number of joints in a status


@dataclass(frozen=True)
class StatusLayout:
    """A status of N joints as bytes.

    Attributes:
        size: Number of bytes.
        fingerprint: The first eight bytes, its type.
        q: Offset of the positions, big-endian doubles one after the other.
        v: Offset of the velocities.
        torque: Offset of the torques.
        torque_sign: 1, or -1 if torques have the opposite sign.
        robot_mode: Offset of the robot mode, one byte; None if there is none.
        control_mode: Offset of the control mode, one byte; None if there is none.
    """

    size: int
    fingerprint: bytes
    q: int
    v: int
    torque: int
    torque_sign: int
    robot_mode: int | None
    control_mode: int | None

    @classmethod
    def of(cls, dialect: Dialect, joints: int) -> "StatusLayout":
        """Return the layout of a dialect's status.

        Args:
            dialect: The dialect.
            joints: Number N of joints.
        """
        q, v, torque = np.split(1.0 + np.arange(3 * joints), 3)
        status = RobotStatus(0, q, v, torque, RobotMode.OTHER, ControlMode.NONE)
        data = dialect.encode_status(status)
        assert struct.unpack_from(">i", data, _COUNT) == (joints,)
        sign = 1 if _doubles(torque) in data else -1
        return cls(
            len(data),
            data[_TYPE],
            data.index(_doubles(q)),
            data.index(_doubles(v)),
            data.index(_doubles(sign * torque)),
            sign,
            _changed_byte(dialect, status, replace(status, robot_mode=RobotMode.MOVE)),
            _changed_byte(dialect, status, replace(status, control_mode=ControlMode.TORQUE)),
        )


def command_layout(dialect: Dialect, mode: ControlMode, joints: int) -> tuple[bytes, int]:
    """Return the layout of a dialect's command.

    Args:
        dialect: The dialect.
        mode: Control mode.
        joints: Number N of joints.

    Returns:
        A command whose time and values are zero; and the offset of the values, big-endian doubles
            one after the other.
    """
    values = 1.0 + np.arange(joints)
    data = dialect.encode_command(RobotCommand(0, mode, values))
    zero = dialect.encode_command(RobotCommand(0, mode, 0.0 * values))
    return zero, data.index(_doubles(values))


def wrench_layout() -> tuple[int, bytes]:
    """Return the size of a force sensor's message, and the bytes of its type."""
    data = encode_wrench(0, np.zeros(6))
    return len(data), data[_TYPE]


def _doubles(values: np.ndarray) -> bytes:
    return struct.pack(f">{len(values)}d", *values)


def _changed_byte(dialect: Dialect, status: RobotStatus, other: RobotStatus) -> int | None:
    """Return the index of the only byte in which two statuses differ, None if they are equal."""
    one, two = (np.frombuffer(dialect.encode_status(s), np.uint8) for s in (status, other))
    indices = np.flatnonzero(one != two)
    assert len(indices) <= 1
    return int(indices[0]) if len(indices) else None


@dataclass(frozen=True)
class UdpmAddress:
    """Multicast address of a message bus.

    Attributes:
        address: Multicast address.
        port: Port.
        ttl: Number of routers that messages may pass; 0 keeps them on this machine.
    """

    address: str
    port: int
    ttl: int

    @classmethod
    def of(cls, url: str) -> "UdpmAddress":
        """Read an address in LCM's form, ``udpm://239.255.76.67:7667?ttl=0``.

        Args:
            url: The address; omitted parts have LCM's defaults.

        Raises:
            InputError: If it is not such an address.
        """
        try:
            parts = urlsplit(url)
            found = cls(
                parts.hostname or _ADDRESS,
                parts.port or _PORT,
                int(parse_qs(parts.query).get("ttl", ["0"])[0]),
            )
            is_good = ipaddress.IPv4Address(found.address).is_multicast and 0 <= found.ttl <= 255
        except ValueError:
            is_good = False
        if not url.startswith("udpm://") or not is_good:
            raise InputError(
                f"--lcm {url}: no bus over UDP multicast; allowed: udpm://ADDRESS:PORT?ttl=N, "
                "ADDRESS from 224.0.0.0 to 239.255.255.255"
            )
        return found
