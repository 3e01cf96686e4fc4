"""What a controller in C has to know of a robot's messages: their layout, and where they go."""

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

# LCM's own
_ADDRESS, _PORT = "239.255.76.67", 7667
# every message begins with eight bytes that tell its type; then comes the time
_TYPE = slice(0, 8)
_COUNT = 16  # where a status has the number of its joints


@dataclass(frozen=True)
class StatusLayout:
    """A status of N joints as bytes.

    Attributes:
        size: How many.
        fingerprint: The first eight, its type.
        q: Where its positions begin, as big-endian doubles one after the other.
        v: Its velocities.
        torque: Its torques.
        torque_sign: 1, or -1 where it tells them with the opposite sign.
        robot_mode: Its robot mode, one byte; None if it tells none.
        control_mode: What it is commanded by, one byte; None if it tells none.
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
        """Find where a dialect writes what.

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
            _changed(dialect, status, replace(status, robot_mode=RobotMode.MOVE)),
            _changed(dialect, status, replace(status, control_mode=ControlMode.TORQUE)),
        )


def command_layout(dialect: Dialect, mode: ControlMode, joints: int) -> tuple[bytes, int]:
    """Find where a dialect writes what is commanded.

    Args:
        dialect: The dialect.
        mode: What is commanded.
        joints: Number N of joints.

    Returns:
        A command, its time and what is commanded being zero; and where that begins, as big-endian
        doubles one after the other.
    """
    values = 1.0 + np.arange(joints)
    data = dialect.encode_command(RobotCommand(0, mode, values))
    zero = dialect.encode_command(RobotCommand(0, mode, 0.0 * values))
    return zero, data.index(_doubles(values))


def wrench_layout() -> tuple[int, bytes]:
    """Return the size of a force sensor's message, and the bytes that tell its type."""
    data = encode_wrench(0, np.zeros(6))
    return len(data), data[_TYPE]


def _doubles(values: np.ndarray) -> bytes:
    return struct.pack(f">{len(values)}d", *values)


def _changed(dialect: Dialect, status: RobotStatus, other: RobotStatus) -> int | None:
    """Return the one byte in which two statuses differ, None if they do not."""
    one, two = (np.frombuffer(dialect.encode_status(s), np.uint8) for s in (status, other))
    places = np.flatnonzero(one != two)
    assert len(places) <= 1
    return int(places[0]) if len(places) else None


@dataclass(frozen=True)
class UdpmAddress:
    """Where the messages of a bus are sent.

    Attributes:
        address: Multicast address.
        port: Port.
        ttl: How many routers they may pass; 0 keeps them on this machine.
    """

    address: str
    port: int
    ttl: int

    @classmethod
    def of(cls, url: str) -> "UdpmAddress":
        """Read an address as LCM writes it, ``udpm://239.255.76.67:7667?ttl=0``.

        Args:
            url: The address; what is left out of it is as LCM has it.

        Raises:
            InputError: If it is none.
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
