"""The controller of a scenario as C99, with the record of a run."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pydrake.systems.analysis import Simulator

from diagrams.controller_part import ControllerPart, controller_part
from diagrams.scenario import SimulationParameters
from diagrams.station import Station
from experiments.preparation import naming, prepare
from experiments.scenario_file import ScenarioFile
from experiments.simulation import configure
from pfsc_drake.codegen.c_controller import CController
from pfsc_drake.codegen.export import check_project, write_project
from reporting.progress import ProgressListener


@dataclass(frozen=True)
class Export:
    """A controller that has been written.

    Attributes:
        files: All files, among them a record of the run.
        controller: What they hold.
    """

    files: list[Path]
    controller: CController


def export_scenario(
    scenario: ScenarioFile, out: Path, duration: float, progress: ProgressListener
) -> Export:
    """Write the controller of a scenario as C99.

    Args:
        scenario: The scenario as read.
        out: Folder for the files.
        duration: How much of the run is simulated and recorded [s].
        progress: Told what goes on.

    Raises:
        InputError: If the scenario is wrong, something in its controller is no block, or the folder
            holds files that no export has written; nothing has been simulated then.
    """
    check_project(out)
    simulation = (scenario.data.get("simulation") or {}) | {"fused": False}
    whole = replace(scenario, data=scenario.data | {"simulation": simulation})
    prepared = prepare(whole, None, recording=False, progress=progress)
    station = prepared.station
    root = station.diagram.CreateDefaultContext()
    station.set_start(root)
    with naming(scenario.path):
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
    return Export(files, controller)


def record(
    station: Station, part: ControllerPart, how: SimulationParameters, duration: float
) -> np.ndarray:
    """Simulate a station, and return its controller's inputs and outputs.

    They are what whatever is sampled sees at a tick. A discrete plant with sampled ports has made
    the step that begins with the tick by then, while blocks remember what they did before it.

    Args:
        station: The station, block by block.
        part: Its controller.
        how: How it is simulated.
        duration: Duration of the run [s].

    Returns:
        Of each tick, in the order of ``interface.json``, shape (ticks, inputs and outputs).
    """
    simulator = Simulator(station.diagram)
    configure(simulator, how.integrator, how.max_step, how.accuracy)
    root = simulator.get_mutable_context()
    station.set_start(root)
    simulator.Initialize()
    seen, plant, step = root, station.part.plant, station.part.drives.step
    if step is not None:
        seen = root.Clone()
    ports = [*part.inputs.values(), *part.outputs.values()]
    contexts = [port.get_system().GetMyContextFromRoot(seen) for port in ports]
    rows = []
    for tick in range(round(duration / part.period)):
        # states are those before this tick's update, with which the next advance begins
        if tick > 0:
            simulator.AdvanceTo(tick * part.period)
        if step is not None:
            seen.SetTimeStateAndParametersFrom(root)
            simulator.AdvanceTo(tick * part.period + 0.5 * step)
            stepped = plant.GetMyContextFromRoot(root)
            plant.GetMyMutableContextFromRoot(seen).SetStateAndParametersFrom(stepped)
        rows.append(
            np.concatenate([p.Eval(context) for p, context in zip(ports, contexts, strict=True)])
        )
    return np.array(rows)
