"""The controller of a driven scenario in C, with the loop that drives a robot by it."""

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
from experiments.hardware.drive import PACE, Drive
from experiments.hardware.native_record import RecordFormat
from experiments.preparation import PreparedRun, naming
from experiments.scenario_file import ScenarioFile
from pfsc_drake.codegen.c_controller import CController
from pfsc_drake.compiled.c_source import c_source
from pfsc_drake.drivers.layout import StatusLayout, UdpmAddress, command_layout, wrench_layout
from pfsc_drake.drivers.link import ControllerEnd
from pfsc_drake.drivers.messages import FORCE_TORQUE_CHANNEL, ControlMode, Dialect, RobotMode
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import gravity_function
from reporting.progress import ProgressListener

PROGRAM = "drive_lcm"
_LOOP = Path(pfsc_drake.codegen.__file__).parent / "harness" / "lcm"
_SETUP = "drive_setup.h"
PRIORITY = 50  # of who drives, where real-time priority is allowed
_HEAD = 8  # bytes of a packet before its channel
# of :mod:`experiments.hardware.check`, which the loop has to know
_LIMITS = (
    *("AT_REST", "AT_START", "SILENCE", "BRIDGED", "LARGEST_GAP", "LEAST_JUMP"),
    *("LONGEST_STOP", "RESTED_FOR", "STOP_FACTOR", "STOP_SPEED"),
)
# where drive_told has the controller's inputs
_TOLD = {
    "joint_state": "joint_state",
    "joint_torque": "joint_torque",
    "measured_wrench": "wrench",
    "stop_request": "&stop_request",
    "override": "&override",
}


@dataclass(frozen=True)
class NativeProject:
    """A controller with its loop, as C.

    Attributes:
        folder: With its files.
        record: How its record is written.
    """

    folder: Path
    record: RecordFormat

    @property
    def program(self) -> Path:
        """The loop, once it is compiled."""
        return self.folder / PROGRAM

    def compile(self, progress: ProgressListener, optimization: str = "") -> None:
        """Compile what has changed since the last time, one file after the other.

        Args:
            progress: Told what goes on.
            optimization: Options of the compiler instead of those of the Makefile.

        Raises:
            InputError: If there is no compiler, or it says anything.
        """
        compile_files(sorted(self.folder.glob("*.c")), PROGRAM, progress, optimization)


def check_native(end: ControllerEnd, folder: Path) -> UdpmAddress:
    """Refuse what no controller in C can be made or run with, and return the address of a bus.

    Args:
        end: The link.
        folder: Where the controller is to go.

    Raises:
        InputError: If the bus is of another kind, there is no compiler, or the folder holds what
            somebody else has written.
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
    """Write the controller of a scenario for a robot that stands elsewhere, with its loop.

    Args:
        scenario: The scenario as read.
        prepared: What was made of it.
        drive: What the loop is to do.
        dialect: The robot's messages.
        folder: Where the files go; what has not changed is left alone.

    Raises:
        InputError: If something in the controller is no block.
    """
    _check_folder(folder)
    settings = deepcopy(prepared.settings)
    settings.simulation.fused = False
    with naming(scenario.path):
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
        unknown = [name for name in inputs if name not in _TOLD]
        if unknown:
            raise InputError(f"--native: nobody tells the controller {', '.join(unknown)}")
        files = controller.files()
    assert isinstance(station.part, RemoteArm)
    robot = station.part.belief.robot
    files |= c_source({"weight": gravity_function(robot)}, "robot")
    status = StatusLayout.of(dialect, robot.dimension)
    record = RecordFormat(robot.dimension, status.size)
    command = command_layout(dialect, drive.mode, robot.dimension)
    # where the controller's memory has the pace of the reference
    pace = controller.program.states[PACE].start + 1 if drive.has_motion else 0
    files[_SETUP] = _header(drive, dialect, status, command, record, pace)
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
    pace: int,
) -> str:
    """Return what the loop must know, as macros and declarations."""
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
        "DRIVE_PACE": pace,
        "STATUS_CHANNEL": f'"{dialect.status_channel}"',
        "STATUS_SIZE": status.size,
        "STATUS_ROOM": record.room,
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
    """Return what the loop must know of numbers, and what leads to the controller's inputs."""
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
        f"    memcpy(inputs->{name}, {_member(_TOLD[name])}, sizeof inputs->{name});"
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
