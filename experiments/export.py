"""Export of a scenario's controller as C99, with the record of a run."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator

from diagrams.controller_part import ControllerPart, controller_part
from diagrams.scenario import Scenario, SimulationParameters
from diagrams.station import Station
from experiments.calls import quiet_libraries, resolve_scenario, shown_progress
from experiments.controller_replay import Commands, Replay, check_export, missing_tool, replay_log
from experiments.preparation import naming, prepare
from experiments.saved_run import Run
from experiments.scenario_file import ScenarioFile, expand_home
from experiments.simulation import configure
from pfsc_drake.checks import require_positive
from pfsc_drake.codegen.c_controller import CController
from pfsc_drake.codegen.c_project import check_project, write_project
from pfsc_drake.errors import InputError
from reporting.progress import ProgressListener


def export_scenario(
    scenario: ScenarioFile, out: Path, duration: float, progress: ProgressListener
) -> tuple[CController, list[Path]]:
    """Write the controller of a scenario as C99; return it, and all files that were written.

    Args:
        scenario: The scenario as read.
        out: Folder for the files.
        duration: Duration of the simulated and recorded run [s].
        progress: Progress listener.

    Raises:
        InputError: If the scenario is wrong, part of its controller is not a block, or the folder
            holds files of other origin; nothing has been simulated then.
    """
    check_project(out)
    simulation = (scenario.data.get("simulation") or {}) | {"fused": False}
    whole = replace(scenario, data=scenario.data | {"simulation": simulation})
    prepared = prepare(whole, None, recording=False, progress=progress)
    station = prepared.station
    root = station.diagram.CreateDefaultContext()
    station.set_start(root)
    with naming(scenario.source):
        part = controller_part(station)
        controller = CController.of(
            part.network,
            part.period,
            title=f"Controller of {prepared.settings.name}",
            presets=part.presets(station, root),
            scenario=prepared.settings.name,
            hash=scenario.fingerprint,
            turning=tuple(station.robot.gather("is_revolute").tolist()),
        )
        progress(0.0, "recording a run")
        recorded = record(station, part, prepared.settings.simulation, duration)
        progress(0.0, "writing C")
        files = write_project(controller, out, recorded)
    return controller, files


def record(
    station: Station, part: ControllerPart, how: SimulationParameters, duration: float
) -> np.ndarray:
    """Simulate a station, and return its controller's inputs and outputs.

    They are the values at the sampling instants. A discrete plant with sampled ports has then
    performed the step that begins with the tick, while blocks hold their states from before it.

    Args:
        station: The station, block by block.
        part: Its controller.
        how: Parameters of the simulation.
        duration: Duration of the run [s].

    Returns:
        One row per tick in the order of ``interface.json``, shape (ticks, inputs and outputs).
    """
    simulator = Simulator(station.diagram)
    configure(simulator, how.integrator, how.max_step, how.accuracy)
    root = simulator.get_mutable_context()
    station.set_start(root)
    simulator.Initialize()
    sampled, plant, step = root, station.part.plant, station.part.drives.step
    if step is not None:
        sampled = root.Clone()
    ports = [*part.inputs.values(), *part.outputs.values()]
    contexts = [port.get_system().GetMyContextFromRoot(sampled) for port in ports]
    rows = []
    for tick in range(round(duration / part.period)):
        # states are those before this tick's update, with which the next advance begins
        if tick > 0:
            simulator.AdvanceTo(tick * part.period)
        if step is not None:
            sampled.SetTimeStateAndParametersFrom(root)
            simulator.AdvanceTo(tick * part.period + 0.5 * step)
            stepped = plant.GetMyContextFromRoot(root)
            plant.GetMyMutableContextFromRoot(sampled).SetStateAndParametersFrom(stepped)
        rows.append(
            np.concatenate([p.Eval(context) for p, context in zip(ports, contexts, strict=True)])
        )
    return np.array(rows)


@dataclass(frozen=True)
class ExportedController:
    """A controller as C99, in a folder.

    Attributes:
        folder: Folder of the files.
        files: All files written.
        check: Comparison with the recorded run, ``check.differing`` ticks of ``check.ticks``; None
            if not requested.
    """

    folder: Path
    files: list[Path]
    check: Replay | None = None

    @cached_property
    def interface(self) -> dict[str, Any]:
        """Inputs and outputs with sizes and units, state in bytes, sampling time [s]."""
        content: dict[str, Any] = json.loads((self.folder / "interface.json").read_text("utf-8"))
        return content

    def replay(self, log: Run | str | Path, *, quiet: bool = False) -> Commands:
        """Return the controller's drive commands for a log, tick by tick; needs gcc and make.

        Args:
            log: A run, its ``log.h5``, or a CSV file of a robot with columns ``t``, ``q_1``, ..,
                ``v_1``, ..
            quiet: Whether to show no progress.

        Raises:
            InputError: If it cannot be compiled, or the log lacks a required signal.
        """
        file = log.folder / "log.h5" if isinstance(log, Run) else expand_home(Path(log))
        with shown_progress(self.folder.name, None, quiet, paced=False) as progress:
            return replay_log(self.folder, file, progress)


def export_controller(
    scenario: str | Path | Scenario,
    changes: Mapping[str, Any] | None = None,
    *,
    out: str | Path,
    check: bool = False,
    duration: float = 1.0,
    quiet: bool = False,
) -> ExportedController:
    """Write the controller of a scenario as C99, with the record of a run beside it.

    Args:
        scenario: As of :func:`run`.
        changes: As of :func:`run`.
        out: Folder for the files.
        check: Whether to compile it, replay the run and compare; needs gcc and make.
        duration: Simulated time of that run [s].
        quiet: Whether to show no progress.

    Raises:
        InputError: If the scenario or an argument is wrong, part of the controller is not a block,
            or there is no compiler for a check.
    """
    require_positive("duration", duration)
    lacking = missing_tool() if check else None
    if lacking is not None:
        raise InputError(f"check = True: there is no {lacking} here; allowed: check = False")
    loaded, folder = resolve_scenario(scenario, changes or {}), expand_home(Path(out))
    with quiet_libraries(), shown_progress(loaded.name, None, quiet, paced=False) as progress:
        _, files = export_scenario(loaded, folder, duration, progress)
        replay = check_export(folder, progress) if check else None
    return ExportedController(folder, files, replay)
