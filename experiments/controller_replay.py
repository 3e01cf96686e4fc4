"""Compilation and replay of exported controllers: recorded runs and logs."""

import json
import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.results.run_log import RunLog
from pfsc_drake.codegen.c_project import LOG
from pfsc_drake.errors import InputError, shorten
from pfsc_drake.geometry.files.number_table import read_numbers
from reporting.progress import ProgressListener

COMMANDS = "commands.csv"
_LONGEST = 1200.0  # s
_RESULT = re.compile(
    r"ticks (\d+) differing (\d+) largest (\S+) "
    r"median_us ([\d.]+) p99_us ([\d.]+) worst_us ([\d.]+)"
)
_TOOLS = ("gcc", "make")
# a force sensor's, whichever port it feeds
_WRENCH, _WRENCH_SIZE = "wrench_sensor", 6
# measured joint torques, by port
_TORQUES_OF_JOINTS = {"joint_torque": "tau_J_measured"}
_LINKS, _MOTORS = ("q_J", "v_J"), ("q_M", "v_M")
_TORQUE = "drive_torque"
_ROUNDING = 1e-6  # of a tick
# of an interface
_PORT, _LARGEST_PORT = {"name": str, "size": int, "unit": str}, 100_000


@dataclass(frozen=True)
class Replay:
    """Comparison of the C controller with a recorded run.

    Attributes:
        ticks: Ticks of the run.
        differing: Number of ticks with an output that is not bit-identical.
        largest: Largest difference of an output from the record, infinite where one is NaN.
        median, p99, worst: Computing times of a step [us].
        text: Printed output.
    """

    ticks: int
    differing: int
    largest: float
    median: float
    p99: float
    worst: float
    text: str


@dataclass(frozen=True)
class Commands:
    """Drive commands of an exported controller for a log.

    Attributes:
        port: Name of the output port to the drives.
        unit: Its unit.
        times: Times of the ticks [s], shape (ticks,).
        values: Drive commands, shape (ticks, N).
        fault: The first fault, 0 for none.
        fault_time: Time of the first fault [s].
        difference: Largest difference of each drive's command from the log, shape (N,); None if the
            log has no commands.
        assumed: Assumption about the log, or empty.
        file: Table of all outputs at all ticks.
    """

    port: str
    unit: str
    times: np.ndarray
    values: np.ndarray
    fault: int
    fault_time: float
    difference: np.ndarray | None
    assumed: str
    file: Path


def missing_tool() -> str | None:
    """Return the first build tool that is missing on this machine, or None."""
    return next((tool for tool in _TOOLS if shutil.which(tool) is None), None)


def check_export(
    folder: Path, progress: ProgressListener, optimization: str = "", steps: int | None = None
) -> Replay:
    """Compile an exported controller and replay its recorded run.

    Args:
        folder: Folder of the exported files.
        progress: Progress listener.
        optimization: Compiler options that replace the Makefile's.
        steps: Number of timed steps, 1e6 if omitted.

    Raises:
        InputError: If it cannot be compiled or run.
    """
    compile_replay(folder, progress, optimization)
    progress(0.0, "repeating the run")
    arguments = [LOG] if steps is None else [LOG, str(steps)]
    replayed = _run([str(folder.resolve() / "replay"), *arguments], folder)
    found = _RESULT.search(replayed.stdout)
    if found is None:
        raise InputError(f"{folder}/replay ended with status {replayed.returncode}")
    ticks, differing = int(found[1]), int(found[2])
    largest, median, p99, worst = (float(found[i]) for i in (3, 4, 5, 6))
    return Replay(ticks, differing, largest, median, p99, worst, replayed.stdout)


def compile_replay(folder: Path, progress: ProgressListener, optimization: str = "") -> None:
    """Compile an exported controller with its replay program, see :func:`compile_files`.

    Args:
        folder: Folder of the exported files.
        progress: Progress listener.
        optimization: Compiler options that replace the Makefile's.
    """
    sources = [folder / "replay.c", *sorted(folder.glob("controller*.c"))]
    compile_files(sources, "replay", progress, optimization)


def compile_files(
    sources: Sequence[Path], program: str, progress: ProgressListener, optimization: str = ""
) -> None:
    """Compile the files that changed since the last call, one after the other.

    Args:
        sources: The files, beside their Makefile.
        program: Target of the Makefile.
        progress: Progress listener.
        optimization: Compiler options that replace the Makefile's.

    Raises:
        InputError: If there is no compiler, or it prints a message.
    """
    folder = sources[0].parent
    options = [f"OPTIMIZATION={optimization}"] if optimization else []
    for source in sources:
        progress(0.0, f"compiling {source.name}, {source.stat().st_size / 1e6:.1f} MB")
        make(folder, source.with_suffix(".o").name, options)
    make(folder, program, options)


def replay_log(folder: Path, log: Path, progress: ProgressListener) -> Commands:
    """Feed a log to an exported controller.

    Args:
        folder: Folder of the exported files.
        log: ``log.h5`` of a run, or a CSV file with columns ``t``, ``q_1`` .. ``q_N``, ``v_1`` ..
            ``v_N``, perhaps ``q_M_1`` .., ``v_M_1`` .. of the motors, and ``name_1`` .. of every
            further input.
        progress: Progress listener.

    Raises:
        InputError: If there is no such controller, it cannot be compiled, or the log lacks a
            required signal.
    """
    interface = _interface(folder)
    is_run = log.suffix.lower() in (".h5", ".hdf5")
    known, inputs, logged, assumed = (_read_run if is_run else _read_csv)(log, interface["inputs"])
    drives = interface["outputs"][0]
    period = interface["sampling_time"]
    ticks = int(np.floor((known[-1] - known[0]) / period + _ROUNDING)) + 1
    times = known[0] + period * np.arange(ticks)
    row = np.searchsorted(known, times + _ROUNDING * period, side="right") - 1
    compile_replay(folder, progress)
    progress(0.0, "feeding the log")
    outputs = _feed(folder, inputs[row], sum(port["size"] for port in interface["outputs"]))
    ends = np.cumsum([0, *(port["size"] for port in interface["outputs"])])
    parts = {
        port["name"]: outputs[:, a:b]
        for port, a, b in zip(interface["outputs"], ends, ends[1:], strict=False)
    }
    values, faults = parts[drives["name"]], np.flatnonzero(parts["fault"][:, 0])
    difference = None
    if logged is not None and drives["name"] == _TORQUE:
        difference = np.abs(values - logged[row]).max(axis=0)
    names = [n for port in interface["outputs"] for n in _columns((port["name"],), port["size"])]
    file = folder / COMMANDS
    np.savetxt(
        file,
        np.column_stack([times, outputs]),
        fmt="%.12g",
        delimiter=",",
        header=",".join(["t", *names]),
        comments="",
    )
    first = faults[0] if faults.size else None
    return Commands(
        drives["name"],
        drives["unit"],
        times,
        values,
        0 if first is None else int(parts["fault"][first, 0]),
        np.nan if first is None else float(times[first]),
        difference,
        assumed,
        file,
    )


# times [s] (n,), inputs (n, size), logged drive commands (n, N), assumption about the log
_Recorded = tuple[np.ndarray, np.ndarray, np.ndarray | None, str]


def _interface(folder: Path) -> dict[str, Any]:
    file = folder / "interface.json"
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        raise InputError(f"{file}: cannot be read; allowed: a folder written by export") from None
    wrong = _misfit(content)
    if wrong:
        raise InputError(f"{file}: {wrong}; allowed: a file written by export")
    return dict(content)


def _misfit(content: Any) -> str:
    """Return the first deviation of an interface from the format of export, or an empty text."""
    if not isinstance(content, dict):
        return "no mapping"
    period = content.get("sampling_time")
    if not (isinstance(period, (int, float)) and 1e-6 <= period <= 1.0):
        return f"sampling_time = {shorten(repr(period))}, not from 1e-6 to 1 s"
    for key in ("inputs", "outputs"):
        ports = content.get(key)
        if not (isinstance(ports, list) and ports):
            return f"no list of {key}"
        for number, port in enumerate(ports):
            fits = isinstance(port, dict) and all(
                isinstance(port.get(name), kind) for name, kind in _PORT.items()
            )
            if not (fits and 0 < port["size"] <= _LARGEST_PORT):
                return f"{key}[{number}] = {shorten(repr(port))}, no port"
    if "fault" not in [port["name"] for port in content["outputs"]]:
        return "no output fault"
    return ""


def _read_run(log: Path, inputs: list[dict[str, Any]]) -> _Recorded:
    run = RunLog.read(log)

    def found(name: str) -> np.ndarray:
        if name not in run:
            raise InputError(f"{log}: no signal {name}, which the controller needs")
        return run[name].values

    columns = []
    for port in inputs:
        if port["name"] == "joint_state":
            suffix = "_measured" if "q_J_measured" in run else ""
            # motors of rigid joints move as the links do, and are not logged
            sides = _LINKS + (_MOTORS if f"q_M{suffix}" in run else _LINKS)
            values = np.hstack([found(f"{name}{suffix}") for name in sides])
        else:
            name = _TORQUES_OF_JOINTS.get(port["name"], port["name"])
            is_sensor = name == port["name"] and name not in run and port["size"] == _WRENCH_SIZE
            values = found(_WRENCH if is_sensor else name)
        columns.append(values)
        if values.shape[1] != port["size"]:
            raise InputError(f"{log}: not of this robot; {port['name']} has {port['size']} numbers")
    torques = run["tau_d"].values if "tau_d" in run else None
    return run.time, np.hstack(columns), torques, ""


def _read_csv(log: Path, inputs: list[dict[str, Any]]) -> _Recorded:
    sizes = {port["name"]: port["size"] for port in inputs}
    joints = sizes.get("joint_state", 0) // 4
    motors, links = _columns(_MOTORS, joints), _columns(("q", "v"), joints)
    others = {n: _columns((n,), size) for n, size in sizes.items() if n != "joint_state"}
    needed = ["t", *links, *(column for names in others.values() for column in names)]

    def check(location: str, header: list[str]) -> None:
        lacking = [name for name in needed if name not in header]
        if lacking:
            raise InputError(f"{location}: no column {lacking[0]}; needed: {', '.join(needed)}")

    table = read_numbers(str(log), "samples", check)
    column = dict(zip(table.header, table.rows.T, strict=True))
    times = column["t"]
    if np.any(np.diff(times) <= 0.0):
        late = table.lines[1 + int(np.argmax(np.diff(times) <= 0.0))]
        raise InputError(f"{log}, line {late}: t does not grow")
    has_motors = all(name in column for name in motors)
    others["joint_state"] = [*links, *(motors if has_motors else links)]
    parts = [column[name] for port in sizes for name in others[port]]
    assumed = (
        "" if has_motors or not joints else "no q_M, v_M: motors are taken to be where q, v is"
    )
    return times, np.column_stack(parts), None, assumed


def _columns(names: Sequence[str], size: int) -> list[str]:
    """Return ``name_1`` .. ``name_size`` of each name."""
    return [f"{name}_{i + 1}" for name in names for i in range(size)]


def _feed(folder: Path, inputs: np.ndarray, size: int) -> np.ndarray:
    """Return the controller's outputs for inputs, shape (ticks, size)."""
    with tempfile.TemporaryDirectory() as scratch:
        read, written = Path(scratch) / "inputs", Path(scratch) / "outputs"
        np.ascontiguousarray(inputs).tofile(read)
        done = _run([str(folder.resolve() / "replay"), "-w", str(read), str(written)], folder)
        if done.returncode != 0:
            raise InputError(f"{folder}/replay ended with status {done.returncode}")
        outputs = np.fromfile(written)
    if outputs.size != len(inputs) * size:
        raise InputError(
            f"{folder}/interface.json: {size} outputs; the controller beside it has another number "
            "of inputs or outputs; allowed: both from one export"
        )
    return outputs.reshape(len(inputs), size)


def make(folder: Path, target: str, options: Sequence[str] = ()) -> None:
    """Build a target with make.

    Args:
        folder: Folder of the Makefile.
        target: Name of the target.
        options: Variables of the Makefile, ``NAME=value``.

    Raises:
        InputError: If there is no make or compiler, or either prints a message.
    """
    lacking = missing_tool()
    if lacking is not None:
        raise InputError(f"{folder}: cannot be compiled: there is no {lacking} here")
    done = _run(["make", "--silent", *options, target], folder)
    if done.returncode != 0 or done.stderr:
        message = (done.stderr.splitlines() or ["nothing"])[0]
        raise InputError(f"{folder}: make {target} says: {message}")


def _run(command: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    try:
        return subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=_LONGEST, check=False
        )
    except subprocess.TimeoutExpired:
        raise InputError(f"{folder}: {command[0]} took more than {_LONGEST:g} s") from None
