"""Exported controllers at work: compiled, compared with a record, and fed with logs."""

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
from pfsc_drake.errors import InputError, shortened
from pfsc_drake.geometry.files.number_table import read_numbers
from reporting.progress import ProgressListener

COMMANDS = "commands.csv"
_LONGEST = 1200.0  # s
_RESULT = re.compile(
    r"ticks (\d+) differing (\d+) largest (\S+) "
    r"median_us ([\d.]+) p99_us ([\d.]+) worst_us ([\d.]+)"
)
_TOOLS = ("gcc", "make")
# a force sensor's, whatever led it to the controller
_WRENCH, _WRENCH_SIZE = "wrench_sensor", 6
# what joints measure of themselves, by port
_TORQUES_OF_JOINTS = {"joint_torque": "tau_J_measured"}
_LINKS, _MOTORS = ("q_J", "v_J"), ("q_M", "v_M")
_TORQUE = "drive_torque"
_ROUNDING = 1e-6  # of a tick
# of an interface
_PORT, _LARGEST_PORT = {"name": str, "size": int, "unit": str}, 100_000


@dataclass(frozen=True)
class Replay:
    """What the controller in C made of a recorded run.

    Attributes:
        ticks: Ticks of the run.
        differing: How many of them have an output that is not the same to the last bit.
        largest: Largest difference of an output from the record, infinite where one is NaN.
        median, p99, worst: Times of a step, in a row [us].
        text: What was printed.
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
    """What an exported controller would have told the drives.

    Attributes:
        port: Name of what the drives are told.
        unit: Its unit.
        times: Times of the ticks [s], shape (ticks,).
        told: What the drives are told, shape (ticks, N).
        fault: The first fault, 0 for none.
        fault_time: When it came [s].
        difference: From what the log says the drives were told, largest magnitude of each, shape
            (N,); None if it does not say.
        assumed: What was assumed of the log, if anything.
        file: Where all outputs at all ticks are.
    """

    port: str
    unit: str
    times: np.ndarray
    told: np.ndarray
    fault: int
    fault_time: float
    difference: np.ndarray | None
    assumed: str
    file: Path


def missing_tool() -> str | None:
    """Return what is needed to compile and is not on this machine, None if all is there."""
    return next((tool for tool in _TOOLS if shutil.which(tool) is None), None)


def check_export(
    folder: Path, progress: ProgressListener, optimization: str = "", steps: int | None = None
) -> Replay:
    """Compile an exported controller and let it repeat the run that is recorded beside it.

    Args:
        folder: With the files.
        progress: Told what goes on.
        optimization: Options of the compiler instead of those of the Makefile.
        steps: How many are measured, 1e6 if omitted.

    Raises:
        InputError: If it cannot be compiled, or not be run.
    """
    compile_replay(folder, progress, optimization)
    progress(0.0, "repeating the run")
    given = [LOG] if steps is None else [LOG, str(steps)]
    replayed = _run([str(folder.resolve() / "replay"), *given], folder)
    found = _RESULT.search(replayed.stdout)
    if found is None:
        raise InputError(f"{folder}/replay ended with status {replayed.returncode}")
    ticks, differing = int(found[1]), int(found[2])
    largest, median, p99, worst = (float(found[i]) for i in (3, 4, 5, 6))
    return Replay(ticks, differing, largest, median, p99, worst, replayed.stdout)


def compile_replay(folder: Path, progress: ProgressListener, optimization: str = "") -> None:
    """Compile an exported controller and what feeds it, see :func:`compile_files`.

    Args:
        folder: With the files.
        progress: Told what goes on.
        optimization: Options of the compiler instead of those of the Makefile.
    """
    sources = [folder / "replay.c", *sorted(folder.glob("controller*.c"))]
    compile_files(sources, "replay", progress, optimization)


def compile_files(
    sources: Sequence[Path], program: str, progress: ProgressListener, optimization: str = ""
) -> None:
    """Compile what has changed since the last time, one file after the other.

    Args:
        sources: The files, beside their Makefile.
        program: What it makes of them.
        progress: Told what goes on.
        optimization: Options of the compiler instead of those of the Makefile.

    Raises:
        InputError: If there is no compiler, or it says anything.
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
        folder: With the files.
        log: ``log.h5`` of a run, or a CSV file with columns ``t``, ``q_1`` .. ``q_N``, ``v_1`` ..
            ``v_N``, perhaps ``q_M_1`` .., ``v_M_1`` .. of the motors, and ``name_1`` .. of every
            further input.
        progress: Told what goes on.

    Raises:
        InputError: If there is no such controller, it cannot be compiled, or the log does not tell
            what it needs.
    """
    said = _interface(folder)
    is_run = log.suffix.lower() in (".h5", ".hdf5")
    known, inputs, logged, assumed = (_of_run if is_run else _of_csv)(log, said["inputs"])
    drives = said["outputs"][0]
    period = said["sampling_time"]
    ticks = int(np.floor((known[-1] - known[0]) / period + _ROUNDING)) + 1
    times = known[0] + period * np.arange(ticks)
    row = np.searchsorted(known, times + _ROUNDING * period, side="right") - 1
    compile_replay(folder, progress)
    progress(0.0, "feeding the log")
    outputs = _fed(folder, inputs[row], sum(port["size"] for port in said["outputs"]))
    ends = np.cumsum([0, *(port["size"] for port in said["outputs"])])
    parts = {
        port["name"]: outputs[:, a:b]
        for port, a, b in zip(said["outputs"], ends, ends[1:], strict=False)
    }
    told, faults = parts[drives["name"]], np.flatnonzero(parts["fault"][:, 0])
    difference = None
    if logged is not None and drives["name"] == _TORQUE:
        difference = np.abs(told - logged[row]).max(axis=0)
    names = [n for port in said["outputs"] for n in _columns((port["name"],), port["size"])]
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
        told,
        0 if first is None else int(parts["fault"][first, 0]),
        np.nan if first is None else float(times[first]),
        difference,
        assumed,
        file,
    )


# times [s] (n,), inputs (n, size), what drives were told (n, N), and what was assumed
_Recorded = tuple[np.ndarray, np.ndarray, np.ndarray | None, str]


def _interface(folder: Path) -> dict[str, Any]:
    file = folder / "interface.json"
    try:
        said = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        raise InputError(
            f"{file}: cannot be read; allowed: a folder that export has written"
        ) from None
    wrong = _misfit(said)
    if wrong:
        raise InputError(f"{file}: {wrong}; allowed: what export has written")
    return dict(said)


def _misfit(said: Any) -> str:
    """Return what of an interface is not as export writes it, empty if all is."""
    if not isinstance(said, dict):
        return "no mapping"
    period = said.get("sampling_time")
    if not (isinstance(period, (int, float)) and 1e-6 <= period <= 1.0):
        return f"sampling_time = {shortened(repr(period))}, not from 1e-6 to 1 s"
    for key in ("inputs", "outputs"):
        ports = said.get(key)
        if not (isinstance(ports, list) and ports):
            return f"no list of {key}"
        for number, port in enumerate(ports):
            fits = isinstance(port, dict) and all(
                isinstance(port.get(name), kind) for name, kind in _PORT.items()
            )
            if not (fits and 0 < port["size"] <= _LARGEST_PORT):
                return f"{key}[{number}] = {shortened(repr(port))}, no port"
    if "fault" not in [port["name"] for port in said["outputs"]]:
        return "no output fault"
    return ""


def _of_run(log: Path, inputs: list[dict[str, Any]]) -> _Recorded:
    run = RunLog.read(log)

    def found(name: str) -> np.ndarray:
        if name not in run:
            raise InputError(f"{log}: no signal {name}, which the controller needs")
        return run[name].values

    columns = []
    for port in inputs:
        if port["name"] == "joint_state":
            seen = "_measured" if "q_J_measured" in run else ""
            # motors of rigid joints move as the links do, and are not logged
            sides = _LINKS + (_MOTORS if f"q_M{seen}" in run else _LINKS)
            values = np.hstack([found(f"{name}{seen}") for name in sides])
        else:
            name = _TORQUES_OF_JOINTS.get(port["name"], port["name"])
            is_sensor = name == port["name"] and name not in run and port["size"] == _WRENCH_SIZE
            values = found(_WRENCH if is_sensor else name)
        columns.append(values)
        if values.shape[1] != port["size"]:
            raise InputError(f"{log}: not of this robot; {port['name']} has {port['size']} numbers")
    told = run["tau_d"].values if "tau_d" in run else None
    return run.time, np.hstack(columns), told, ""


def _of_csv(log: Path, inputs: list[dict[str, Any]]) -> _Recorded:
    sizes = {port["name"]: port["size"] for port in inputs}
    joints = sizes.get("joint_state", 0) // 4
    motors, links = _columns(_MOTORS, joints), _columns(("q", "v"), joints)
    others = {n: _columns((n,), size) for n, size in sizes.items() if n != "joint_state"}
    needed = ["t", *links, *(column for names in others.values() for column in names)]

    def check(place: str, header: list[str]) -> None:
        lacking = [name for name in needed if name not in header]
        if lacking:
            raise InputError(f"{place}: no column {lacking[0]}; needed: {', '.join(needed)}")

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


def _fed(folder: Path, inputs: np.ndarray, size: int) -> np.ndarray:
    """Return what the controller makes of inputs, shape (ticks, size)."""
    with tempfile.TemporaryDirectory() as place:
        given, made = Path(place) / "inputs", Path(place) / "outputs"
        np.ascontiguousarray(inputs).tofile(given)
        done = _run([str(folder.resolve() / "replay"), "-w", str(given), str(made)], folder)
        if done.returncode != 0:
            raise InputError(f"{folder}/replay ended with status {done.returncode}")
        outputs = np.fromfile(made)
    if outputs.size != len(inputs) * size:
        raise InputError(
            f"{folder}/interface.json: {size} outputs; the controller beside it has another number "
            "of inputs or outputs; allowed: both from one export"
        )
    return outputs.reshape(len(inputs), size)


def make(folder: Path, target: str, options: Sequence[str] = ()) -> None:
    """Let make build a target.

    Args:
        folder: With the Makefile.
        target: What.
        options: Variables of the Makefile, ``NAME=value``.

    Raises:
        InputError: If there is no make or compiler, or either says anything.
    """
    lacking = missing_tool()
    if lacking is not None:
        raise InputError(f"{folder}: cannot be compiled: there is no {lacking} here")
    done = _run(["make", "--silent", *options, target], folder)
    if done.returncode != 0 or done.stderr:
        said = (done.stderr.splitlines() or ["nothing"])[0]
        raise InputError(f"{folder}: make {target} says: {said}")


def _run(command: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    try:
        return subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=_LONGEST, check=False
        )
    except subprocess.TimeoutExpired:
        raise InputError(f"{folder}: {command[0]} took more than {_LONGEST:g} s") from None
