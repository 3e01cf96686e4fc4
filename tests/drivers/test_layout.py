"""Layout of messages: numbers written there are those that Drake's types read."""

import struct

import numpy as np
import pytest

from pfsc_drake.drivers.layout import StatusLayout, UdpmAddress, command_layout, wrench_layout
from pfsc_drake.drivers.messages import (
    ControlMode,
    RobotCommand,
    RobotMode,
    RobotStatus,
    decode_wrench,
    dialect,
    encode_wrench,
)
from pfsc_drake.errors import InputError

RANDOM = np.random.default_rng(0)
MODES = [
    ("panda", ControlMode.TORQUE),
    ("panda", ControlMode.VELOCITY),
    ("iiwa", ControlMode.TORQUE),
]


def doubles(values):
    return struct.pack(f">{len(values)}d", *values)


@pytest.mark.parametrize("kind", ["panda", "iiwa"])
@pytest.mark.parametrize("joints", [1, 6, 7])
def test_a_status(kind, joints):
    spoken = dialect(kind)
    layout = StatusLayout.of(spoken, joints)
    zeros = np.zeros(joints)
    data = bytearray(spoken.encode_status(RobotStatus(0, zeros, zeros, zeros)))
    assert len(data) == layout.size
    assert data[:8] == layout.fingerprint
    q, v, torque = RANDOM.normal(size=(3, joints))
    data[8:16] = struct.pack(">q", 77)
    for offset, values in ((layout.q, q), (layout.v, v), (layout.torque, torque)):
        data[offset : offset + 8 * joints] = doubles(values)
    found = spoken.decode_status(bytes(data))
    assert found.utime == 77
    np.testing.assert_array_equal([found.q, found.v], [q, v])
    np.testing.assert_array_equal(found.torque, layout.torque_sign * torque)
    if kind == "panda":
        data[layout.robot_mode], data[layout.control_mode] = 3, 1
        found = spoken.decode_status(bytes(data))
        assert (found.robot_mode, found.control_mode) == (RobotMode.GUIDING, ControlMode.POSITION)
    else:
        assert (layout.robot_mode, layout.control_mode) == (None, None)


@pytest.mark.parametrize(("kind", "mode"), MODES)
@pytest.mark.parametrize("joints", [1, 6, 7])
def test_a_command(kind, mode, joints):
    spoken, values = dialect(kind), RANDOM.normal(size=joints)
    message, begin = command_layout(spoken, mode, joints)
    data = bytearray(message)
    data[8:16] = struct.pack(">q", 78)
    data[begin : begin + 8 * joints] = doubles(values)
    assert bytes(data) == spoken.encode_command(RobotCommand(78, mode, values))


def test_a_force_sensors_reading():
    wrench, (size, fingerprint) = RANDOM.normal(size=6), wrench_layout()
    data = encode_wrench(5, wrench)
    assert (len(data), data[:8]) == (size, fingerprint)
    np.testing.assert_array_equal(decode_wrench(fingerprint + data[8:16] + doubles(wrench)), wrench)


@pytest.mark.parametrize(
    ("url", "address"),
    [
        ("udpm://", UdpmAddress("239.255.76.67", 7667, 0)),
        ("udpm://239.255.76.67:7667?ttl=1", UdpmAddress("239.255.76.67", 7667, 1)),
        ("udpm://239.1.2.3", UdpmAddress("239.1.2.3", 7667, 0)),
        ("udpm://:7000?recv_buf_size=100&ttl=3", UdpmAddress("239.255.76.67", 7000, 3)),
    ],
)
def test_addresses_as_lcm_writes_them(url, address):
    assert UdpmAddress.of(url) == address


@pytest.mark.parametrize(
    "url",
    [
        *("memq://", "tcpq://localhost:7700", "", "udpm", "udpm://10.0.0.1", "udpm://localhost"),
        *("udpm://239.1.1.1:70000", "udpm://239.1.1.1?ttl=256", "udpm://?ttl=far", "udpm://[::1"),
    ],
)
def test_what_is_no_address(url):
    with pytest.raises(InputError, match="no bus over UDP multicast; allowed: udpm://ADDRESS:PORT"):
        UdpmAddress.of(url)
