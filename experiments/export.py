"""The controller of a scenario as C99, and whether it does what it does here."""

import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.systems.analysis import Simulator

from diagrams.controller_part import ControllerPart, controller_part
from diagrams.scenario import SimulationParameters
from diagrams.station import Station
from experiments.catalog.scenario_file import ScenarioFile
from experiments.preparation import naming, prepare
from experiments.simulation import configure
from pfsc_drake.compiled.operations import Untranslatable
from pfsc_drake.errors import InputError
from pfsc_drake.export.c_controller import CController
from pfsc_drake.export.project import write_project
from reporting.progress import ProgressListener

_LONGEST_COMPILATION = 600.0  # s
_LONGEST_REPLAY = 120.0  # s
_RESULT = re.compile(
    r"ticks (\d+) differing (\d+) median_us ([\d.]+) p99_us ([\d.]+) worst_us ([\d.]+)"
)


@dataclass(frozen=True)
class Replay:
    """What the controller in C made of a recorded run.

    Attributes:
        ticks: Of the run.
        differing: How many of them have an output that is not the same to the last bit.
        median, p99, worst: Times of a step, in a row [us].
        text: What was printed.
    """

    ticks: int
    differing: int
    median: float
    p99: float
    worst: float
    text: str


@dataclass(frozen=True)
class Export:
    """A controller that has been written.

    Attributes:
        files: All files.
        controller: What they hold.
        station: The station that it was taken from, block by block.
        part: Where in the station it was.
        simulation: How the station is simulated.
    """

    files: list[Path]
    controller: CController
    station: Station
    part: ControllerPart
    simulation: SimulationParameters


def export_scenario(scenario: ScenarioFile, out: Path, progress: ProgressListener) -> Export:
    """Write the controller of a scenario as C99.

    Args:
        scenario: The scenario as read.
        out: Folder for the files.
        progress: Told what goes on.

    Raises:
        InputError: If the scenario is wrong, or something in its controller is no block.
    """
    whole = {"fused": False}
    scenario.data["simulation"] = (scenario.data.get("simulation") or {}) | whole
    prepared = prepare(scenario, None, recording=False, progress=progress)
    station = prepared.station
    root = station.diagram.CreateDefaultContext()
    station.set_start(root)
    with naming(scenario.path):
        part = controller_part(station)
        progress(0.0, "writing C")
        controller = CController.of(
            part.network,
            part.period,
            title=f"Controller of {prepared.settings.name}",
            presets=part.presets(station, root),
            scenario=prepared.settings.name,
        )
        try:
            files = write_project(controller, out)
        except Untranslatable as error:
            raise InputError(f"export: {error}, which has no translation to C") from None
    return Export(files, controller, station, part, prepared.settings.simulation)


def record(export: Export, duration: float) -> np.ndarray:
    """Simulate the scenario, and return the controller's inputs and outputs.

    Args:
        export: The controller.
        duration: Of the run [s].

    Returns:
        Of each tick, in the order of ``interface.json``, shape (ticks, inputs and outputs).

    Raises:
        InputError: If the plant is discrete.
    """
    station, part = export.station, export.part
    if station.part.drives.step is not None:
        raise InputError(
            "export --check: the plant is discrete and steps at a tick before the controller; "
            "what the controller is told then cannot be recorded"
        )
    simulator = Simulator(station.diagram)
    how = export.simulation
    configure(simulator, how.integrator, how.max_step, how.accuracy)
    root = simulator.get_mutable_context()
    station.set_start(root)
    simulator.Initialize()
    ports = [*part.inputs.values(), *part.outputs.values()]
    contexts = [port.get_system().GetMyContextFromRoot(root) for port in ports]
    rows = []
    for tick in range(round(duration / part.period)):
        # states are those before this tick's update, with which the next advance begins
        if tick > 0:
            simulator.AdvanceTo(tick * part.period)
        rows.append(
            np.concatenate([p.Eval(context) for p, context in zip(ports, contexts, strict=True)])
        )
    return np.array(rows)


def check_export(folder: Path, recorded: np.ndarray, optimization: str = "-O2") -> Replay | None:
    """Compile an exported controller and let it repeat a run.

    Args:
        folder: With the files.
        recorded: See :func:`record`.
        optimization: Option of the compiler.

    Returns:
        What came out; None if there is no compiler.

    Raises:
        InputError: If it cannot be compiled, or not be run.
    """
    recorded.tofile(folder / "replay.bin")
    compiler = shutil.which("gcc")
    if compiler is None:
        return None
    sources = ["replay.c", "controller.c", "controller_functions.c"]
    warnings = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion"]
    command = [compiler, optimization, "-std=c99", *warnings, "-o", "replay", *sources, "-lm"]
    compiled = _run(command, folder, _LONGEST_COMPILATION)
    if compiled.returncode != 0 or compiled.stderr:
        raise InputError(f"{folder}: gcc says: {(compiled.stderr.splitlines() or ['nothing'])[0]}")
    replayed = _run([str(folder.resolve() / "replay")], folder, _LONGEST_REPLAY)
    found = _RESULT.search(replayed.stdout)
    if found is None:
        raise InputError(f"{folder}/replay ended with status {replayed.returncode}")
    ticks, differing = int(found[1]), int(found[2])
    median, p99, worst = (float(found[i]) for i in (3, 4, 5))
    return Replay(ticks, differing, median, p99, worst, replayed.stdout)


def _run(command: list[str], folder: Path, longest: float) -> subprocess.CompletedProcess[str]:
    try:
        return subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=longest, check=False
        )
    except subprocess.TimeoutExpired:
        raise InputError(f"{folder}: {command[0]} took more than {longest:g} s") from None
