"""Export of a driven scenario's controller as C, with the loop that drives the robot."""

import math
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import pfsc_drake.codegen
from diagrams.builder import build_station
from diagrams.controller_part import controller_part
from diagrams.robots.remote_arm import RemoteArm
from experiments.controller_replay import compile_files, missing_tool
from experiments.hardware import check
from experiments.hardware.drive import SPEED_SCALING, Drive
from experiments.hardware.native_record import RecordFormat
from experiments.preparation import PreparedRun, naming
from experiments.scenario_file import ScenarioFile
from pfsc_drake.codegen.c_controller import CController
from pfsc_drake.compiled.c_source import c_source
from pfsc_drake.drivers.layout import StatusLayout, UdpmAddress, command_layout, wrench_layout
from pfsc_drake.drivers.link import ControllerEndpoint
from pfsc_drake.drivers.messages import FORCE_TORQUE_CHANNEL, ControlMode, Dialect, RobotMode
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import gravity_function
from reporting.progress import ProgressListener

PROGRAM = "drive_lcm"
_LOOP = Path(pfsc_drake.codegen.__file__).parent / "harness" / "lcm"
_SETUP = "drive_setup.h"
PRIORITY = 50  # real-time priority of the driving process, if allowed
_HEAD = 8  # bytes of a packet before its channel
# constants of :mod:`experiments.hardware.check` for the loop
_LIMITS = (
    *("AT_REST", "AT_START", "SILENCE", "BRIDGED", "LARGEST_GAP", "LEAST_JUMP"),
    *("LONGEST_STOP", "RESTED_FOR", "STOP_FACTOR", "STOP_SPEED"),
)
# members of drive_told for the controller's inputs
_SOURCES = {
    "joint_state": "joint_state",
    "joint_torque": "joint_torque",
    "measured_wrench": "wrench",
    "stop_request": "&stop_request",
    "override": "&override",
}


@dataclass(frozen=True)
class NativeProject:
    """Controller and loop as a C project.

    Attributes:
        folder: Folder of the files.
        record: Format of its record.
    """

    folder: Path
    record: RecordFormat

    @property
    def program(self) -> Path:
        """The compiled loop."""
        return self.folder / PROGRAM

    def compile(self, progress: ProgressListener, optimization: str = "") -> None:
        """Compile the changed files, one after the other.

        Args:
            progress: Progress listener.
            optimization: Compiler options that replace the Makefile's.

        Raises:
            InputError: If there is no compiler, or it prints a message.
        """
        compile_files(sorted(self.folder.glob("*.c")), PROGRAM, progress, optimization)


def check_native(end: ControllerEndpoint, folder: Path) -> UdpmAddress:
    """Check the requirements of a controller in C, and return the address of the bus.

    Args:
        end: The link.
        folder: Folder for the controller.

    Raises:
        InputError: If the bus is of another kind, there is no compiler, or the folder holds other
            files.
    """
    lacking = missing_tool()
    if lacking is not None:
        raise InputError(f"--native: the controller cannot be compiled: there is no {lacking} here")
    address = UdpmAddress.of(end.lcm.get_lcm_url())
    _check_folder(folder)
    return address


def _check_folder(folder: Path) -> None:
    if folder.exists() and not (
        folder.is_dir() and ((folder / _SETUP).is_file() or not any(folder.iterdir()))
    ):
        raise InputError(f"{folder}: holds something else; allowed: another --out")


def write_native(
    scenario: ScenarioFile,
    prepared: PreparedRun,
    drive: Drive,
    dialect: Dialect,
    folder: Path,
) -> NativeProject:
    """Write a scenario's controller for a robot in another process as C, with its loop.

    Args:
        scenario: The scenario as read.
        prepared: Its prepared run.
        drive: Python description of the loop.
        dialect: The robot's messages.
        folder: Folder for the files; unchanged files are not rewritten.

    Raises:
        InputError: If part of the controller is not a block.
    """
    _check_folder(folder)
    settings = deepcopy(prepared.settings)
    settings.simulation.fused = False
    with naming(scenario.source):
        station = build_station(settings, scenario.path.parent, remote=True)
        root = station.diagram.CreateDefaultContext()
        station.set_start(root)
        part = controller_part(station)
        controller = CController.of(
            part.network,
            part.period,
            title=f"Controller of {settings.name} for a robot that is driven",
            presets=part.presets(station, root),
            scenario=settings.name,
            hash=scenario.fingerprint,
            turning=tuple(station.robot.gather("is_revolute").tolist()),
        )
        inputs = [port["name"] for port in controller.interface()["inputs"]]
        unknown = [name for name in inputs if name not in _SOURCES]
        if unknown:
            raise InputError(f"--native: inputs without a source: {', '.join(unknown)}")
        files = controller.files()
    assert isinstance(station.part, RemoteArm)
    robot = station.part.nominal_model.robot
    files |= c_source({"weight": gravity_function(robot)}, "robot")
    status = StatusLayout.of(dialect, robot.dimension)
    record = RecordFormat(robot.dimension, status.size)
    command = command_layout(dialect, drive.mode, robot.dimension)
    # index of the reference's speed scaling in the controller's state
    scaling_index = controller.program.states[SPEED_SCALING].start + 1 if drive.has_motion else 0
    files[_SETUP] = _header(drive, dialect, status, command, record, scaling_index)
    files["drive_setup.c"] = _source(drive, station.start_posture, status, command[0], inputs)
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        _replace(folder / name, text)
    for file in _LOOP.iterdir():
        _replace(folder / file.name, file.read_text(encoding="utf-8"))
    return NativeProject(folder, record)


def _replace(file: Path, text: str) -> None:
    if not file.is_file() or file.read_text(encoding="utf-8") != text:
        file.write_text(text, encoding="utf-8")


def _header(
    drive: Drive,
    dialect: Dialect,
    status: StatusLayout,
    command: tuple[bytes, int],
    record: RecordFormat,
    scaling_index: int,
) -> str:
    """Return macros and declarations of the loop's parameters."""
    wrench_size, _ = wrench_layout()
    channel = dialect.command_channel
    constants: dict[str, object] = {
        "DRIVE_JOINTS": record.joints,
        "DRIVE_IS_TORQUE": int(drive.mode is ControlMode.TORQUE),
        "DRIVE_MODE": int(drive.mode),
        "DRIVE_MOVES": int(RobotMode.MOVE),
        "DRIVE_PRIORITY": PRIORITY,
        **{f"DRIVE_{name}": getattr(check, name) for name in _LIMITS},
        "DRIVE_HAS_MOTION": int(drive.has_motion),
        "DRIVE_PACE": scaling_index,
        "STATUS_CHANNEL": f'"{dialect.status_channel}"',
        "STATUS_SIZE": status.size,
        "STATUS_ROOM": record.capacity,
        "STATUS_Q": status.q,
        "STATUS_V": status.v,
        "STATUS_TORQUE": status.torque,
        "STATUS_TORQUE_SIGN": float(status.torque_sign),
        "WRENCH_CHANNEL": f'"{FORCE_TORQUE_CHANNEL}"',
        "WRENCH_SIZE": wrench_size,
        "COMMAND_CHANNEL": f'"{channel}"',
        "COMMAND_SIZE": len(command[0]),
        "COMMAND_VALUES": command[1],
        "COMMAND_PACKET_SIZE": _HEAD + len(channel) + 1 + len(command[0]),
    }
    if status.robot_mode is not None:
        constants["STATUS_ROBOT_MODE"] = status.robot_mode
        constants["STATUS_CONTROL_MODE"] = status.control_mode
    macros = "\n".join(f"#define {name} {value}" for name, value in constants.items())
    return f"""\
/* The robot, its messages, and what a controller allows itself. SI units. */
#ifndef DRIVE_SETUP_H
#define DRIVE_SETUP_H

{macros}

extern const unsigned char status_fingerprint[8], wrench_fingerprint[8];
extern const unsigned char command_message[COMMAND_SIZE];

/* posture at the start; largest torques that are sent, their rates, and speeds that no joint has */
extern const double drive_start[DRIVE_JOINTS], drive_limit[DRIVE_JOINTS];
extern const double drive_rate[DRIVE_JOINTS], drive_fastest[DRIVE_JOINTS];

#endif
"""


def _source(
    drive: Drive,
    start: np.ndarray,
    status: StatusLayout,
    command: bytes,
    inputs: Sequence[str],
) -> str:
    """Return definitions of the loop's parameters and the controller's inputs."""
    _, wrench = wrench_layout()
    arrays: Mapping[str, bytes | np.ndarray] = {
        "unsigned char status_fingerprint": status.fingerprint,
        "unsigned char wrench_fingerprint": wrench,
        "unsigned char command_message": command,
        "double drive_start": start,
        "double drive_limit": drive.limit,
        "double drive_rate": drive.rate,
        "double drive_fastest": drive.inputs.fastest,
    }
    texts = [
        f"const {name}[] = {{{', '.join(map(_literal, values))}}};"
        for name, values in arrays.items()
    ]
    moved = "\n".join(
        f"    memcpy(inputs->{name}, {_member(_SOURCES[name])}, sizeof inputs->{name});"
        for name in inputs
    )
    return f"""\
#include <math.h>
#include <string.h>

#include "drive.h"

{chr(10).join(texts)}

void drive_fill(controller_inputs *inputs, const drive_told *told)
{{
{moved}
}}
"""


def _member(name: str) -> str:
    return f"&told->{name[1:]}" if name.startswith("&") else f"told->{name}"


def _literal(value: float) -> str:
    if isinstance(value, int):
        return str(value)
    return repr(float(value)) if math.isfinite(value) else "INFINITY"
