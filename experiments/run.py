"""One run: from a scenario file to log, metrics, figures, recording and report."""

import gc
import shutil
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
from diagrams.wording import posture_text
from experiments.catalog.scenario_file import ScenarioFile
from experiments.figures.all import write_figures
from experiments.pages.report import write_report
from experiments.progress import ProgressListener
from experiments.results.joint_limits import JointLimits
from experiments.results.metrics import Metrics
from experiments.results.path_metrics import metric_names, path_following_metrics
from experiments.results.provenance import standard_attributes
from experiments.results.run_log import RunLog
from experiments.results.run_signals import collect_log, collect_motion, optional_signals
from experiments.results.tick import measure_tick
from experiments.simulation import simulate
from pfsc_drake.compiled.bound_function import compiled_when_bound
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.typed import load_typed

_PATH_POINTS = 600
_MOVING = 0.01  # m/s, from which on the tool counts as moving


@dataclass
class RunOutcome:
    """What a run left.

    Attributes:
        fault: Why the run was stopped, or None if it completed.
        report: The page to open.
        metrics: Its metrics.
        warnings: What may not have gone as well as hoped, one sentence each.
    """

    fault: str | None
    report: Path
    metrics: Metrics
    warnings: list[str]


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

    Args:
        scenario: The scenario as read.
        out: Folder for the results; files of an earlier run are replaced.
        duration: Simulated time [s] instead of the scenario's.
        figures: Whether to draw figures.
        recording: Whether to record the motion.
        progress: Told how far the run is.

    Raises:
        InputError: If the scenario is wrong; nothing has moved then.
    """
    progress(0.0, "preparing")
    settings = load_typed(PathFollowingScenario, scenario.data, str(scenario.path))
    try:
        with compiled_when_bound():
            station = build_station(settings, scenario.path.parent)
        _check_targets(settings, station)
    except InputError as error:
        raise InputError(f"{scenario.path}: {error}") from None
    settings.name = settings.name or scenario.name
    settings.duration = duration or settings.duration or station.reference_duration
    _resolve_files(settings, scenario.path.parent)
    _prepare_folder(out)
    (out / "scenario.yaml").write_text(yaml_dump_typed(settings), encoding="utf-8")

    progress.expect(settings.duration)
    with _steady_clock():
        result = simulate(station, settings.simulation, settings.duration, progress)
        end = float(result.root.get_time())
        log = collect_log(station, result.root)
        log.attributes = standard_attributes(scenario.name)
        log.attributes["start_posture"] = posture_text(station.robot, station.start_posture)
        if result.fault is not None:
            log.attributes["fault"] = result.fault
        log.write(out / "log.h5")
        motion = collect_motion(station, result.root, settings.simulation.frame_period)
        progress(end, "measuring the tick")
        tick = measure_tick(station, result.root, log) * 1e6
    metrics = _metrics(log, settings)
    limits = JointLimits.of(station.robot)
    metrics.update(limits.metrics(log))
    warnings = [*station.warnings, *limits.warnings(log)]
    metrics.add("real_time_factor", result.real_time_factor, "1")
    median, p99 = np.percentile(tick, [50, 99]) if len(tick) else (np.nan, np.nan)
    metrics.add("controller_tick_us", float(median), "us", source="median")
    metrics.add("controller_tick_us_p99", float(p99), "us")
    for name, target in settings.targets.get(settings.controller.law, {}).items():
        metrics.set_target(name, target.bound, target.source)
    metrics.write(out / "metrics.json")

    page = None
    if recording and len(motion.times) > 1:
        progress(end, "recording")
        page = _write_recording(settings, scenario.path.parent, station, motion, out)
    progress(end, "drawing")
    pictures = write_figures(log, _path_points(station), out / "figures") if figures else []
    report = write_report(
        out,
        title=scenario.name,
        description=settings.description,
        warnings=warnings,
        scenario_yaml_text=(out / "scenario.yaml").read_text(encoding="utf-8"),
        metrics=metrics,
        figures=pictures,
        log_attributes=log.attributes,
        recording=page,
        fault=result.fault,
        diagram_svg=block_diagram_svg(station.diagram) if figures else None,
    )
    progress(end, "done")
    return RunOutcome(result.fault, report, metrics, warnings)


def _check_targets(settings: PathFollowingScenario, station: Station) -> None:
    """Refuse a target for a metric that the run will not have."""
    signals = optional_signals(station)
    known = [
        *metric_names(station.robot.dimension, signals),
        *JointLimits.of(station.robot).metric_names(),
        "real_time_factor",
        "controller_tick_us",
        "controller_tick_us_p99",
    ]
    for name in settings.targets.get(settings.controller.law, {}):
        if name not in known:
            raise InputError(
                f"targets.{settings.controller.law}.{name}: no such metric; "
                f"allowed: {', '.join(known)}"
            )


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


def _prepare_folder(out: Path) -> None:
    """Make the folder for the results and take away what an earlier run left there."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        for name in ("scenario.yaml", "log.h5", "metrics.json", "recording.html", "report.html"):
            (out / name).unlink(missing_ok=True)
        shutil.rmtree(out / "figures", ignore_errors=True)
    except OSError as error:
        raise InputError(
            f"--out {out}: cannot be written: {error.strerror}; allowed: a folder to write in"
        ) from None


def _metrics(log: RunLog, settings: PathFollowingScenario) -> Metrics:
    """The tool comes to the path during the first rest; from then on deviations count."""
    return path_following_metrics(
        log, settings.settling_tolerance, settings.reference.dwell, _MOVING
    )


def _path_points(station: Station) -> np.ndarray:
    """Points of the path to draw [m], shape (k, 3)."""
    curve = station.path.position
    return curve.derivatives(np.linspace(*curve.domain, _PATH_POINTS), 0)[:, 0, :]


def _write_recording(
    settings: PathFollowingScenario,
    folder: Path,
    station: Station,
    motion: RecordedMotion,
    out: Path,
) -> Path:
    meshcat = Meshcat(MeshcatParams(host="localhost"))
    diagram = build_station_replay(settings, folder, station, motion, meshcat)
    recording = record(diagram, meshcat, motion.times[-1], settings.simulation.frame_period)
    page = out / "recording.html"
    page.write_text(recording, encoding="utf-8")
    return page


@contextmanager
def _steady_clock() -> Iterator[None]:
    """Keep the garbage collector from walking, amid the measured time, through all made before."""
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
