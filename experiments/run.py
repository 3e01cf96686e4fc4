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

from diagrams.block_diagram import block_diagram_svg
from diagrams.path_following import PathFollowingStation, build_path_following
from diagrams.replay import RecordedMotion, build_replay, record
from diagrams.scenario import PathFollowingScenario
from experiments.figures import write_figures
from experiments.metrics import Metrics
from experiments.path_metrics import path_following_metrics
from experiments.progress import ProgressListener
from experiments.provenance import standard_attributes
from experiments.report import write_report
from experiments.run_log import RunLog
from experiments.scenario_file import ScenarioFile
from experiments.simulation import collect_log, collect_motion, simulate
from experiments.tick import measure_tick
from pfsc_drake.typed_yaml import load_typed

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
    station = build_path_following(settings, scenario.path.parent)
    out.mkdir(parents=True, exist_ok=True)
    (out / "scenario.yaml").write_text(yaml_dump_typed(settings), encoding="utf-8")

    span = duration or settings.duration or station.reference_duration
    progress.expect(span)
    with _steady_clock():
        result = simulate(station, settings.simulation, span, progress)
        end = float(result.root.get_time())
        log = collect_log(station, result.root)
        log.attributes = standard_attributes(scenario.name)
        log.attributes["fault"] = result.fault or ""
        log.write(out / "log.h5")
        motion = collect_motion(station, result.root, settings.simulation.frame_period)
        progress(end, "measuring the tick")
        tick = measure_tick(station, result.root, log) * 1e6
    metrics = _metrics(log, settings)
    metrics.add("real_time_factor", result.real_time_factor, "1")
    if len(tick):
        metrics.add("controller_tick_us", float(np.median(tick)), "us", source="median")
        metrics.add("controller_tick_us_p99", float(np.percentile(tick, 99)), "us")
    for name, target in settings.targets.get(settings.controller.law, {}).items():
        metrics.set_target(name, target.bound, target.source)
    metrics.write(out / "metrics.json")

    page = None
    if recording and len(motion.times) > 1:
        progress(end, "recording")
        page = _write_recording(settings, scenario.path.parent, station, motion, out)
    progress(end, "drawing")
    shutil.rmtree(out / "figures", ignore_errors=True)
    pictures = write_figures(log, _path_points(station), out / "figures") if figures else []
    report = write_report(
        out,
        title=scenario.name,
        description=settings.description,
        warnings=station.warnings,
        scenario_yaml_text=(out / "scenario.yaml").read_text(encoding="utf-8"),
        metrics=metrics,
        figures=pictures,
        log_attributes=log.attributes,
        recording=page,
        fault=result.fault,
        diagram_svg=block_diagram_svg(station.diagram) if figures else None,
    )
    progress(end, "done")
    return RunOutcome(result.fault, report, metrics, station.warnings)


def _metrics(log: RunLog, settings: PathFollowingScenario) -> Metrics:
    """The tool comes to the path during the first rest; from then on deviations count."""
    return path_following_metrics(
        log, settings.settling_tolerance, settings.reference.dwell, _MOVING
    )


def _path_points(station: PathFollowingStation) -> np.ndarray:
    """Points of the path to draw [m], shape (k, 3)."""
    curve = station.path.position
    return curve.derivatives(np.linspace(*curve.domain, _PATH_POINTS), 0)[:, 0, :]


def _write_recording(
    settings: PathFollowingScenario,
    folder: Path,
    station: PathFollowingStation,
    motion: RecordedMotion,
    out: Path,
) -> Path:
    meshcat = Meshcat(MeshcatParams(host="localhost"))
    period = settings.simulation.frame_period
    layout = station.law.linearization.layout
    diagram = build_replay(settings.robot, folder, station.path, layout, motion, meshcat, period)
    page = out / "recording.html"
    page.write_text(record(diagram, meshcat, motion.times[-1], period), encoding="utf-8")
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
