"""What is written for a robot that is driven in C, and its messages byte for byte."""

import ctypes
import shutil
import struct
import subprocess
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.lcm import DrakeLcm

from experiments.hardware.driven_run import DriveOptions, drive_scenario
from experiments.hardware.native_project import check_native
from experiments.scenario_file import read_scenario
from pfsc_drake.drivers.link import ControllerEndpoint
from pfsc_drake.drivers.messages import (
    ControlMode,
    RobotCommand,
    RobotMode,
    RobotStatus,
    dialect,
    encode_wrench,
)
from pfsc_drake.errors import InputError
from tests.compilers import needs_gcc
from tests.experiments.hardware.native_bench import Bench, quiet

RANDOM = np.random.default_rng(0)
WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]


class Status(ctypes.Structure):
    """As ``drive_status`` of ``messages.h``."""

    _fields_ = (
        ("utime", ctypes.c_int64),
        *((name, ctypes.c_double * 7) for name in ("q", "v", "torque")),
        *((name, ctypes.c_int) for name in ("robot_mode", "control_mode")),
    )


@pytest.fixture(scope="module", params=["panda", "iiwa"], name="bench")
def fixture_bench(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param) / "native"
    bench = Bench(folder, "pfc_panda_7r", [], request.param)
    bench.project  # noqa: B018
    return bench


@pytest.fixture(scope="module", name="messages")
def fixture_messages(bench, tmp_path_factory):
    """What reads and writes messages, compiled with all warnings."""
    library = tmp_path_factory.mktemp("library") / "messages.so"
    sources = ["messages.c", "drive_setup.c"]
    command = ["gcc", "-std=c99", "-O1", *WARNINGS, "-shared", "-fPIC", "-o", str(library)]
    subprocess.run([*command, *sources], cwd=bench.folder, check=True)
    found = ctypes.CDLL(str(library))
    found.packet_message.restype = ctypes.c_void_p
    return found


def status_of(k):
    q, v, torque = RANDOM.normal(size=(3, 7))
    modes = RobotMode(k % 7), ControlMode(k % 8)
    return RobotStatus(int(RANDOM.integers(-(2**62), 2**62)), q, v, torque, *modes)


def packet(channel, data, magic=b"LC02"):
    return magic + struct.pack(">I", 5) + channel.encode() + b"\0" + data


@needs_gcc
def test_statuses_are_read_as_drake_reads_them(bench, messages):
    spoken = bench.dialect
    for k in range(20):
        data = spoken.encode_status(status_of(k))
        expected, found = spoken.decode_status(data), Status()
        assert messages.decode_status(data, ctypes.c_size_t(len(data)), ctypes.byref(found))
        assert found.utime == expected.utime
        for name in ("q", "v", "torque"):
            assert bytes(getattr(found, name)) == getattr(expected, name).tobytes()
        assert found.robot_mode == expected.robot_mode
        assert found.control_mode == expected.control_mode


@needs_gcc
def test_what_is_no_status_of_this_robot_is_not_read(bench, messages):
    spoken, other = bench.dialect, dialect("iiwa" if bench.dialect.name == "panda" else "panda")
    status = replace(status_of(2), robot_mode=RobotMode.MOVE)
    six = replace(status, q=status.q[:6], v=status.v[:6], torque=status.torque[:6])
    good = spoken.encode_status(status)
    bad = [b"", good[:-1], good + b"\0", spoken.encode_status(six), other.encode_status(status)]
    if spoken.name == "panda":
        bad.append(good[:-10] + bytes([9]) + good[-9:])
        with pytest.raises(ValueError, match="9"):
            spoken.decode_status(bad[-1])
    for data in bad:
        length = ctypes.c_size_t(len(data))
        assert not messages.decode_status(data, length, ctypes.byref(Status()))


@needs_gcc
def test_commands_are_written_as_drake_writes_them(bench, messages):
    spoken = bench.dialect
    for number in (0, 1, 2**32 - 1):
        utime, values = int(RANDOM.integers(-(2**62), 2**62)), RANDOM.normal(size=7)
        data = spoken.encode_command(RobotCommand(utime, ControlMode.TORQUE, values))
        expected = b"LC02" + struct.pack(">I", number)
        expected += spoken.command_channel.encode() + b"\0" + data
        made = ctypes.create_string_buffer(len(expected) + 1)
        given = (ctypes.c_double * 7)(*values)
        messages.encode_command(ctypes.c_uint32(number), ctypes.c_int64(utime), given, made)
        assert made.raw == expected + b"\0"


@needs_gcc
def test_packets_of_other_channels_are_left_alone(bench, messages):
    def read(data, channel):
        length, place = ctypes.c_size_t(), ctypes.create_string_buffer(data, len(data))
        size = ctypes.c_size_t(len(data))
        found = messages.packet_message(place, size, channel.encode(), ctypes.byref(length))
        return None if found is None else ctypes.string_at(found, length.value)

    assert read(packet("FORCE_TORQUE", b"what it says"), "FORCE_TORQUE") == b"what it says"
    assert read(packet("FORCE", b""), "FORCE") == b""
    for data in (
        packet("FORCE_TORQUE", b"x"),
        packet("FORC", b"x"),
        packet("FORCE", b"in pieces", b"LC03"),
        b"LC02",
        packet("FORCE", b"")[:-1],
        b"",
    ):
        assert read(data, "FORCE") is None


@needs_gcc
def test_forces_are_read_as_drake_reads_them(messages):
    wrench, found = RANDOM.normal(size=6), (ctypes.c_double * 6)()
    data = encode_wrench(7, wrench)
    assert messages.decode_wrench(data, ctypes.c_size_t(len(data)), found)
    np.testing.assert_array_equal(found, wrench)
    assert not messages.decode_wrench(data, ctypes.c_size_t(len(data) - 1), found)
    assert not messages.decode_wrench(b"\0" + data[1:], ctypes.c_size_t(len(data)), found)


@pytest.mark.slow(but="panda")
@needs_gcc
def test_the_loop_compiles_without_a_warning(bench):
    for source in ("drive.c", "recorder.c", "drive_lcm.c", "robot_weight.c"):
        command = ["gcc", "-std=c99", "-O1", *WARNINGS, "-pthread", "-c", "-o", "/dev/null", source]
        subprocess.run(command, cwd=bench.folder, check=True)


def test_a_folder_of_somebody_else_is_left_alone(tmp_path):
    bus = SimpleNamespace(get_lcm_url=lambda: "udpm://239.255.76.67:7667?ttl=0")
    (tmp_path / "mine").write_text("")
    if shutil.which("gcc") is None:
        pytest.skip("there is no gcc")
    with pytest.raises(InputError, match="holds something else; allowed: another --out"):
        check_native(SimpleNamespace(lcm=bus), tmp_path)


@pytest.mark.parametrize(
    ("url", "tools", "said"),
    [
        ("memq://", ["gcc", "make"], "--lcm memq://: no bus over UDP multicast; allowed: udpm://"),
        ("memq://", ["make"], "--native: .* compiled: there is no gcc here"),
    ],
)
def test_what_is_refused_before_anything_is_done(tmp_path, monkeypatch, url, tools, said):
    monkeypatch.setattr(shutil, "which", lambda tool: tool if tool in tools else None)
    with pytest.raises(InputError, match=said):
        drive_scenario(
            read_scenario("pfc_panda_7r", []),
            ControllerEndpoint(DrakeLcm(url), dialect("panda")),
            tmp_path / "out",
            DriveOptions(native=True, figures=False, recording=False),
            quiet,
        )
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_what_is_no_block_is_not_driven_in_c(tmp_path):
    with pytest.raises(InputError, match="export: near_regions is no block, but NearRegions"):
        Bench(tmp_path, "vf_many_surfaces", []).project  # noqa: B018
