"""Results of a completed simulation: log, metrics, figures, recording and report."""

import gc
import shlex
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from diagrams.builder import build_station_replay
from diagrams.drawing.block_diagram import block_diagram_svg
from diagrams.drawing.legend import recording_legend, with_legend
from diagrams.drawing.recorded import RecordedMotion
from diagrams.drawing.replay import record
from diagrams.tasks.task_drawing import drawing_of
from experiments.preparation import PreparedRun
from experiments.results.features import FEATURES, render_figures
from experiments.results.joint_limits_feature import DriveLimitsOfRun
from experiments.results.key_results import key_facts, key_metrics
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
from experiments.studies.margins.texts import metrics_of, one_line
from pfsc_drake.robot.coordinate_text import posture_text
from pfsc_drake.systems.drawing.hidden_meshcat import hidden_meshcat
from pfsc_drake.yaml.dumping import changed_data
from pfsc_drake.yaml.reading import dump_yaml
from reporting.folder import ResultsFolder
from reporting.metrics import Metrics
from reporting.page import Page
from reporting.progress import ProgressListener
from reporting.provenance import standard_attributes

_MESHCATS = 3  # of a recording, at most


@dataclass
class RunOutcome:
    """Outcome of a run.

    Attributes:
        fault: Why the run was stopped, or None if it was not.
        report: The report page; None if it could not be written.
        metrics: Its metrics.
        warnings: Warnings, one sentence each.
        interrupted: Whether the user stopped it.
        problem: Results that could not be written, with reason and substitute; or None.
        margins: Stability margins at the start, in one line; None if not requested.
        broken: Violated requirements, one phrase each.
        stop: Description of the motion after a fault; empty without one.
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
    """A run whose simulation is complete.

    Attributes:
        prepared: The prepared run that was simulated.
        name: Name of its scenario.
        result: Result of the simulation.
        analysis: Margins of the loop at the start, if requested.
        attributes: Further attributes of the log.
        further: Adds signals from outside the station to the log.
        simulated: Whether the robot was simulated in this process, not driven over a link.
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
    """Write all results of a run except its scenario.

    Args:
        run: The run.
        results: The folder.
        progress: Progress listener.
        interrupted: Whether to skip slow steps.
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
    page, legend = None, recording_legend(drawing_of(station.task), motion)
    if recording and len(motion.times) > 1 and not interrupted():
        progress(end, "recording")
        page = results.write(
            "recording.html", with_legend(_recording(run.prepared, motion), legend)
        )
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
    content = _report_page(run, log, outcome, results.path, figures=drawn)
    if page is not None:
        content.recording, content.legend = _link(page, results.path), legend
    report = content.write(results)
    progress(end, "done")
    outcome.report, outcome.problem, outcome.interrupted = (
        report.path,
        report.problem,
        interrupted(),
    )
    return outcome


def _collect_log(run: FinishedRun, end: float, interrupted: bool) -> RunLog:
    """Return the log of a run that ended at a time [s], with identifying attributes."""
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
    lasted = log.end > settings.judged_after - 1.5 * settings.controller.sampling_time
    if result.fault is not None or not lasted:
        leave_unjudged(metrics, fault=result.fault is not None)
    return metrics


def _warnings(run: FinishedRun, log: RunLog, metrics: Metrics) -> list[str]:
    """Return warnings about a run, one sentence each."""
    settings, station = run.prepared.settings, run.prepared.station
    own = [x for feature in FEATURES for x in feature.warnings(log, station, settings)]
    return [*run.prepared.warnings, *own, *unjudged_distance(metrics, settings.controller.law)]


def _report_page(
    run: FinishedRun, log: RunLog, outcome: RunOutcome, out: Path, *, figures: bool
) -> Page:
    """Return the report page without recording, with figures if requested."""
    prepared, task, metrics = run.prepared, run.prepared.station.task, outcome.metrics
    settings = prepared.settings
    drawn = render_figures(log, drawing_of(task).outline(), task.fit) if figures else []
    return Page(
        title=run.name,
        kind="Simulation run" if run.simulated else "Robot driven",
        description=settings.description,
        fault=outcome.fault,
        broken=outcome.broken,
        interrupted=outcome.interrupted,
        warnings=outcome.warnings,
        metrics=metrics,
        cards=key_metrics(metrics),
        facts=key_facts(log, metrics, settings.duration, simulated=run.simulated),
        figures=drawn,
        brief=True,
        commands=_further_commands(out, simulated=run.simulated),
        commands_title="Compare",
        changed_yaml_text=dump_yaml(changed_data(settings)),
        scenario_yaml_text=prepared.text,
        diagram_svg=block_diagram_svg(prepared.station.diagram) if drawn else None,
        log_attributes=log.attributes,
    )


def _further_commands(out: Path, *, simulated: bool) -> dict[str, str]:
    """Return command lines that repeat a run and compare it, by their purpose."""
    folder, scenario = (shlex.quote(str(path)) for path in (out, out / "scenario.yaml"))
    again = "Run it again as resolved, or with changes by --set KEY=VALUE, into a folder OTHER."
    commands = {again: f"pfsc run {scenario} --out OTHER"} if simulated else {}
    return commands | {
        "Compare it with that run, or with any other.": f"pfsc compare {folder} OTHER"
    }


def _recording(prepared: PreparedRun, motion: RecordedMotion) -> str:
    """Return the recording as a self-contained page; a Meshcat that is shut down is replaced.

    Raises:
        RuntimeError: If it was shut down repeatedly.
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


def _link(recording: Path, out: Path) -> str:
    """Return the link from the report, in its folder, to the recording."""
    return recording.name if recording.parent == out else str(recording)


@contextmanager
def steady_clock() -> Iterator[None]:
    """Exclude existing objects from garbage collection during the measured time."""
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
