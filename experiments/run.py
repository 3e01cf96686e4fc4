"""One run: from a scenario file to log, metrics, figures, recording and report."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.common.yaml import yaml_dump_typed
from pydrake.geometry import Meshcat, MeshcatParams

from diagrams.builder import build_station, build_station_replay
from diagrams.drawing.block_diagram import block_diagram_svg
from diagrams.drawing.replay import RecordedMotion, record
from diagrams.scenario import PathFollowingScenario, Waypoints
from diagrams.station import Station
from experiments.catalog.scenario_file import ScenarioFile
from experiments.figures.all import render_figures
from experiments.interruption import noticed_interruption
from experiments.length import check_length
from experiments.pages.report import report_page, write_report
from experiments.progress import ProgressListener
from experiments.results.folder import check_folder, open_results
from experiments.results.metrics import Metrics
from experiments.results.path_metrics import path_following_metrics
from experiments.results.provenance import standard_attributes
from experiments.results.run_log import RunLog
from experiments.results.run_signals import collect_log, collect_motion
from experiments.results.targets import check_targets
from experiments.results.tick import measure_tick
from experiments.simulation import simulate
from pfsc_drake.compiled.bound_function import compiled_when_bound
from pfsc_drake.errors import InputError, shortened
from pfsc_drake.yaml.typed import load_typed

_PATH_POINTS = 600
_MOVING = 0.01  # m/s, from which on the tool counts as moving


@dataclass
class RunOutcome:
    """What a run left.

    Attributes:
        fault: Why the run was stopped, or None if it was not.
        report: The page to open; None if it could not be written.
        metrics: Its metrics.
        warnings: What may not have gone as well as hoped, one sentence each.
        interrupted: Whether the user stopped it.
        problem: Which results could not be written, why, and where they are instead; or None.
    """

    fault: str | None
    report: Path | None
    metrics: Metrics
    warnings: list[str]
    interrupted: bool = False
    problem: str | None = None


def run_scenario(
    scenario: ScenarioFile,
    *,
    out: Path,
    duration: float | None,
    figures: bool,
    recording: bool,
    progress: ProgressListener,
) -> RunOutcome:
    """Run a scenario and write everything that a run leaves into a folder.

    Once the simulation has begun, Ctrl-C ends it: what was logged is kept, without pictures.

    Args:
        scenario: The scenario as read.
        out: Folder for the results, see :func:`experiments.results.folder.open_results`.
        duration: Simulated time [s] instead of the scenario's.
        figures: Whether to draw figures.
        recording: Whether to record the motion.
        progress: Told how far the run is.

    Raises:
        InputError: If the scenario is wrong or the folder cannot be used; nothing has moved then.
    """
    progress(0.0, "preparing")
    settings = load_typed(PathFollowingScenario, scenario.data, str(scenario.path))
    inputs = scenario.inputs()
    check_folder(out, "run", inputs)
    with _naming(scenario.path):
        with compiled_when_bound():
            station = build_station(settings, scenario.path.parent)
        check_targets(settings, station)
        settings.name = settings.name or scenario.name
        settings.duration = duration or settings.duration or station.reference_duration
        check_length(settings, station)
    _resolve_files(settings, scenario.path.parent)
    scenario_text = yaml_dump_typed(settings)

    with noticed_interruption() as interrupted, open_results(out, "run", inputs) as results:
        results.write("scenario.yaml", scenario_text)
        progress.expect(settings.duration)
        with _steady_clock():
            result = simulate(
                station, settings.simulation, settings.duration, progress, interrupted
            )
            end = float(result.root.get_time())
            log = collect_log(station, result.root)
            log.attributes = standard_attributes(scenario.name)
            if result.fault is not None:
                log.attributes["fault"] = result.fault
            if interrupted():
                log.attributes["interrupted"] = f"at t = {end:.3f} s"
            results.write("log.h5", log.to_hdf5())
            motion = collect_motion(station, result.root, settings.simulation.frame_period)
            progress(end, "measuring the tick")
            tick = measure_tick(station, result.root, log) * 1e6
        metrics = _metrics(log, settings)
        metrics.add("real_time_factor", result.real_time_factor, "1")
        median, p99 = np.percentile(tick, [50, 99]) if len(tick) else (np.nan, np.nan)
        metrics.add("controller_tick_us", float(median), "us", source="median")
        metrics.add("controller_tick_us_p99", float(p99), "us")
        for name, target in settings.targets.get(settings.controller.law, {}).items():
            metrics.set_target(name, target.bound, target.source)
        results.write("metrics.json", metrics.to_json())

        page = None
        if recording and len(motion.times) > 1 and not interrupted():
            progress(end, "recording")
            content = _recording(settings, scenario.path.parent, station, motion)
            page = results.write("recording.html", content)
        pictures = []
        if figures and not interrupted():
            progress(end, "drawing")
            pictures = render_figures(log, _path_points(station))
        diagram_svg = block_diagram_svg(station.diagram) if pictures else None
        report = write_report(
            results,
            pictures,
            report_page(
                title=scenario.name,
                description=settings.description,
                warnings=station.warnings,
                scenario_yaml_text=scenario_text,
                metrics=metrics,
                figures=pictures,
                log_attributes=log.attributes,
                recording=_link(page, out),
                fault=result.fault,
                interrupted=interrupted(),
                diagram_svg=diagram_svg,
            ),
        )
        progress(end, "done")
        return RunOutcome(
            result.fault, report.path, metrics, station.warnings, interrupted(), report.problem
        )


@contextmanager
def _naming(path: Path) -> Iterator[None]:
    """Name the scenario's file in what is said against it."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except OSError as error:  # of a file that the scenario names
        name = shortened(str(error.filename), 100)
        raise InputError(f"{path}: cannot read {name}: {error.strerror}") from None


def _resolve_files(settings: PathFollowingScenario, folder: Path) -> None:
    """Make file names independent of the scenario's folder, so that the copy runs too."""
    if settings.friction.file and Path(settings.friction.file).suffix:
        settings.friction.file = str((folder / settings.friction.file).resolve())
    if Path(settings.robot.rotor_coupling).suffix:
        settings.robot.rotor_coupling = str((folder / settings.robot.rotor_coupling).resolve())
    shape, model = settings.path.shape, settings.robot.model
    if isinstance(shape, Waypoints):
        shape.file = str((folder / shape.file).resolve())
    if Path(model).suffix and not model.startswith("package://"):
        settings.robot.model = str((folder / model).resolve())


def _metrics(log: RunLog, settings: PathFollowingScenario) -> Metrics:
    """The tool comes to the path during the first rest; from then on deviations count."""
    return path_following_metrics(
        log, settings.settling_tolerance, settings.reference.dwell, _MOVING
    )


def _path_points(station: Station) -> np.ndarray:
    """Points of the path to draw [m], shape (k, 3)."""
    curve = station.path.position
    return curve.derivatives(np.linspace(*curve.domain, _PATH_POINTS), 0)[:, 0, :]


def _recording(
    settings: PathFollowingScenario, folder: Path, station: Station, motion: RecordedMotion
) -> str:
    """Return the recording as a page of its own."""
    meshcat = Meshcat(MeshcatParams(host="localhost"))
    diagram = build_station_replay(settings, folder, station, motion, meshcat)
    return record(diagram, meshcat, motion.times[-1], settings.simulation.frame_period)


def _link(recording: Path | None, out: Path) -> str | None:
    """Return where the report, in its folder, finds the recording."""
    if recording is None:
        return None
    return recording.name if recording.parent == out else str(recording)


@contextmanager
def _steady_clock() -> Iterator[None]:
    """Keep the garbage collector from walking, amid the measured time, through all made before."""
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
