"""What a run leaves when its simulation is over: log, metrics, figures, recording and report."""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from diagrams.builder import build_station_replay
from diagrams.drawing.block_diagram import block_diagram_svg
from diagrams.drawing.recorded import RecordedMotion
from diagrams.drawing.replay import record
from diagrams.tasks.task_drawing import drawing_of
from experiments.preparation import PreparedRun
from experiments.results.features import FEATURES, render_figures
from experiments.results.joint_limits_feature import DriveLimitsOfRun
from experiments.results.recorded_motion import collect_motion
from experiments.results.requirements import (
    leave_unjudged,
    missed_targets,
    set_targets,
    unjudged_distance,
)
from experiments.results.rest_feature import MotionAfterFault
from experiments.results.run_log import RunLog
from experiments.results.run_signals import collect_log
from experiments.simulation import SimulationResult, measure_tick
from experiments.studies.margins.result import MarginAnalysis
from experiments.studies.margins.words import metrics_of, one_line
from pfsc_drake.robot.coordinate_text import posture_text
from pfsc_drake.systems.drawing.hidden_meshcat import hidden_meshcat
from reporting.folder import ResultsFolder
from reporting.metrics import Metrics
from reporting.page import Page
from reporting.progress import ProgressListener
from reporting.provenance import standard_attributes

_MESHCATS = 3  # of a recording, at most


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
        margins: What the loop bears at the start, in one line; None if nobody asked.
        broken: What was promised and not kept, one phrase each.
        stop: How the robot moved after a fault, in words; empty without one.
    """

    fault: str | None
    report: Path | None
    metrics: Metrics
    warnings: list[str]
    interrupted: bool = False
    problem: str | None = None
    margins: str | None = None
    broken: list[str] = field(default_factory=list)
    stop: str = ""


@dataclass(frozen=True)
class FinishedRun:
    """A run whose simulation is over.

    Attributes:
        prepared: What was simulated.
        name: Name of its scenario.
        result: What came of it.
        analysis: What the loop bears at the start, if somebody asked.
        attributes: What else to note in the log.
        further: Adds what the station does not know to the log.
        simulated: Whether the robot was simulated in here, not driven elsewhere.
    """

    prepared: PreparedRun
    name: str
    result: SimulationResult
    analysis: MarginAnalysis | None = None
    attributes: dict[str, str] = field(default_factory=dict)
    further: Callable[[RunLog], None] = lambda log: None
    simulated: bool = True


def write_outcome(
    run: FinishedRun,
    results: ResultsFolder,
    progress: ProgressListener,
    interrupted: Callable[[], bool],
    *,
    figures: bool,
    recording: bool,
) -> RunOutcome:
    """Write everything that a run leaves but its scenario.

    Args:
        run: The run.
        results: The folder.
        progress: Told what goes on.
        interrupted: Whether to leave out what takes long.
        figures: Whether to draw figures.
        recording: Whether to record the motion.
    """
    settings, station, result = run.prepared.settings, run.prepared.station, run.result
    end = float(result.root.get_time())
    with steady_clock():
        log = _collect_log(run, end, interrupted())
        results.write("log.h5", log.to_hdf5())
        frame, dwell = settings.simulation.frame_period, settings.reference.dwell
        motion = collect_motion(station, result.root, frame, log, dwell)
        progress(end, "measuring the tick")
        tick = measure_tick(station, result.root, log) * 1e6
    metrics = _metrics(run, log, tick)
    results.write("metrics.json", metrics.to_json())
    outcome = RunOutcome(
        fault=result.fault,
        report=None,
        metrics=metrics,
        warnings=_warnings(run, log, metrics),
        margins=log.attributes.get("margins"),
        broken=missed_targets(metrics),
    )
    if "fault_time" in log.attributes and log.time.size:
        outcome.stop = MotionAfterFault(log, DriveLimitsOfRun.of(station.robot)).sentence()
    page = None
    if recording and len(motion.times) > 1 and not interrupted():
        progress(end, "recording")
        page = results.write("recording.html", _recording(run.prepared, motion))
    drawn = figures and not interrupted()
    if drawn:
        progress(end, "drawing")
    outcome.interrupted = interrupted()
    results.tell(
        {
            "fault": outcome.fault,
            "missed": outcome.broken,
            "warnings": outcome.warnings,
            "interrupted": outcome.interrupted,
        }
    )
    report = _report_page(run, log, outcome, drawn, _link(page, results.path)).write(results)
    progress(end, "done")
    outcome.report, outcome.problem, outcome.interrupted = (
        report.path,
        report.problem,
        interrupted(),
    )
    return outcome


def _collect_log(run: FinishedRun, end: float, interrupted: bool) -> RunLog:
    """Return the log of a run that ended at a time [s], with what identifies it."""
    prepared, result, station = run.prepared, run.result, run.prepared.station
    log = collect_log(station, result.root)
    run.further(log)
    log["rcond"].limits = np.array([[prepared.settings.controller.min_rcond, np.inf]])
    log.attributes = (
        standard_attributes(run.name)
        | run.attributes
        | {
            "integration": str(prepared.integration),
            "start_posture": posture_text(station.robot, station.start_posture),
        }
    )
    if run.analysis is not None:
        log.attributes["margins"] = one_line(run.analysis)
    if result.fault is not None:
        log.attributes["fault"] = result.fault
        if result.fault_time is not None:
            log.attributes["fault_time"] = f"{result.fault_time:.6f}"
    if interrupted:
        log.attributes["interrupted"] = f"at t = {end:.3f} s"
    return log


def _metrics(run: FinishedRun, log: RunLog, tick: NDArray[np.float64]) -> Metrics:
    """Return metrics with targets; ``tick`` is the wall clock time of samples [us]."""
    settings, result = run.prepared.settings, run.result
    metrics = Metrics()
    for feature in FEATURES:
        metrics |= feature.metrics(log, run.prepared.station, settings)
    metrics.add("real_time_factor", result.real_time_factor)
    median, p99 = np.percentile(tick, [50, 99]) if len(tick) else (np.nan, np.nan)
    metrics.add("controller_tick_us", float(median))
    metrics.add("controller_tick_us_p99", float(p99))
    if run.analysis is not None:
        metrics |= {f"margins_{name}": m for name, m in metrics_of(run.analysis).items()}
    set_targets(metrics, settings)
    # the context's own time is that of the last sample that was measured
    end = float(log.time[-1]) if log.time.size else 0.0
    lasted = end > settings.judged_after - 1.5 * settings.controller.sampling_time
    if result.fault is not None or not lasted:
        leave_unjudged(metrics, fault=result.fault is not None)
    return metrics


def _warnings(run: FinishedRun, log: RunLog, metrics: Metrics) -> list[str]:
    """Return what may not have gone as well as hoped, one sentence each."""
    settings, station = run.prepared.settings, run.prepared.station
    own = [x for feature in FEATURES for x in feature.warnings(log, station, settings)]
    return [*run.prepared.warnings, *own, *unjudged_distance(metrics, settings.controller.law)]


def _report_page(
    run: FinishedRun, log: RunLog, outcome: RunOutcome, drawn: bool, recording: str | None
) -> Page:
    """Return the page that a person opens, with figures if they are to be drawn."""
    prepared, task = run.prepared, run.prepared.station.task
    figures = render_figures(log, drawing_of(task).outline(), task.fit) if drawn else []
    return Page(
        title=run.name,
        kind="Simulation run" if run.simulated else "Robot driven",
        description=prepared.settings.description,
        fault=outcome.fault,
        broken=outcome.broken,
        interrupted=outcome.interrupted,
        warnings=outcome.warnings,
        metrics=outcome.metrics,
        recording=recording,
        figures=figures,
        scenario_yaml_text=prepared.text,
        diagram_svg=block_diagram_svg(prepared.station.diagram) if figures else None,
        log_attributes=log.attributes,
    )


def _recording(prepared: PreparedRun, motion: RecordedMotion) -> str:
    """Return the recording as a page of its own; a Meshcat that is ended from outside is replaced.

    Raises:
        RuntimeError: If it was ended again and again.
    """
    settings = prepared.settings
    for left in reversed(range(_MESHCATS)):
        meshcat = hidden_meshcat()
        try:
            diagram = build_station_replay(
                settings, prepared.station, prepared.drawing, motion, meshcat
            )
            return record(diagram, meshcat, motion.times[-1], settings.simulation.frame_period)
        except RuntimeError:
            if not left:
                raise
    raise AssertionError("the last failure is raised in the loop")


def _link(recording: Path | None, out: Path) -> str | None:
    """Return where the report, in its folder, finds the recording."""
    if recording is None:
        return None
    return recording.name if recording.parent == out else str(recording)


@contextmanager
def steady_clock() -> Iterator[None]:
    """Keep the garbage collector from walking, amid the measured time, through all made before."""
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
