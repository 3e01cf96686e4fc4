"""What a run leaves when its simulation is over: log, metrics, figures, recording and report."""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from diagrams.builder import build_station_replay
from diagrams.drawing.block_diagram import block_diagram_svg
from diagrams.drawing.recorded import RecordedMotion
from diagrams.drawing.replay import record
from diagrams.scenario import Scenario
from diagrams.tasks.task_drawing import drawing_of
from experiments.figures.all import render_figures
from experiments.preparation import PreparedRun
from experiments.results.arrival import arrival_metrics
from experiments.results.drives import (
    DriveLimitsOfRun,
    friction_metrics,
    link_metrics,
    plan_metrics,
    saturation_warnings,
)
from experiments.results.fastest import given_metrics, rate_warnings
from experiments.results.found_links import found_links_metrics
from experiments.results.guidance import guidance_metrics, guidance_warnings, limit_metrics
from experiments.results.guides import guide_metrics
from experiments.results.holder import holder_metrics
from experiments.results.mounting import mounting_metrics
from experiments.results.obstacles import obstacle_metrics
from experiments.results.path import path_following_metrics, press_metrics, shape_metrics
from experiments.results.posture import posture_metrics
from experiments.results.promises import (
    GuidanceRules,
    audit,
    broken_promises,
    leave_unjudged,
    set_promises,
    unpromised_distance,
)
from experiments.results.recorded_motion import collect_motion
from experiments.results.rest import rest_metrics
from experiments.results.run_log import RunLog
from experiments.results.run_signals import collect_log
from experiments.results.stop import MotionAfterFault
from experiments.results.streaming import stream_metrics
from experiments.results.teleoperation import handle_warnings, teleoperation_metrics
from experiments.simulation import SimulationResult, measure_tick
from experiments.studies.margins.result import MarginAnalysis
from experiments.studies.margins.words import metrics_of, one_line
from pfsc_drake.following.fixtures import free_motion
from pfsc_drake.robot.coordinate_text import posture_text
from pfsc_drake.systems.drawing.hidden_meshcat import hidden_meshcat
from reporting.folder import ResultsFolder
from reporting.metrics import Metrics
from reporting.page import Report, report_page, write_report
from reporting.progress import ProgressListener
from reporting.provenance import standard_attributes

_MESHCATS = 3  # of a recording, at most
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


@dataclass(frozen=True)
class _Measured:
    """What was measured of a run.

    Attributes:
        log: All signals.
        motion: What a recording needs of them.
        metrics: Metrics with their targets.
        warnings: What may not have gone as well as hoped, one sentence each.
        fault: Why the run was stopped, or None.
        broken: What was promised and not kept, one phrase each.
        end: When it ended [s].
        stop: How the robot moved after a fault, in words; empty without one.
    """

    log: RunLog
    motion: RecordedMotion
    metrics: Metrics
    warnings: list[str]
    fault: str | None
    broken: list[str]
    end: float
    stop: str


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
    measured = _measure(run, results, progress, interrupted)
    page = None
    if recording and len(measured.motion.times) > 1 and not interrupted():
        progress(measured.end, "recording")
        page = results.write("recording.html", _recording(run.prepared, measured.motion))
    drawn = figures and not interrupted()
    if drawn:
        progress(measured.end, "drawing")
    results.tell(
        {
            "fault": measured.fault,
            "missed": measured.broken,
            "warnings": measured.warnings,
            "interrupted": interrupted(),
        }
    )
    report = _report(run, measured, results, page, drawn, interrupted())
    progress(measured.end, "done")
    return RunOutcome(
        measured.fault,
        report.path,
        measured.metrics,
        measured.warnings,
        interrupted(),
        report.problem,
        None if run.analysis is None else one_line(run.analysis),
        measured.broken,
        measured.stop,
    )


def _measure(
    run: FinishedRun,
    results: ResultsFolder,
    progress: ProgressListener,
    interrupted: Callable[[], bool],
) -> _Measured:
    """Write the log and the metrics of a simulation."""
    prepared, result, analysis = run.prepared, run.result, run.analysis
    settings, station = prepared.settings, prepared.station
    with steady_clock():
        end = float(result.root.get_time())
        log = collect_log(station, result.root)
        run.further(log)
        log["rcond"].limits = np.array([[settings.controller.min_rcond, np.inf]])
        log.attributes = (
            standard_attributes(run.name)
            | run.attributes
            | {
                "integration": str(prepared.integration),
                "start_posture": posture_text(station.robot, station.start_posture),
            }
        )
        if analysis is not None:
            log.attributes["margins"] = one_line(analysis)
        if result.fault is not None:
            log.attributes["fault"] = result.fault
            if result.fault_time is not None:
                log.attributes["fault_time"] = f"{result.fault_time:.6f}"
        if interrupted():
            log.attributes["interrupted"] = f"at t = {end:.3f} s"
        results.write("log.h5", log.to_hdf5())
        motion = collect_motion(
            station,
            result.root,
            settings.simulation.frame_period,
            log,
            settings.reference.dwell,
        )
        progress(end, "measuring the tick")
        tick = measure_tick(station, result.root, log) * 1e6
    metrics = path_following_metrics(
        log, settings.settling_tolerance, converged_after(settings, log), _MOVING
    )
    metrics.update(arrival_metrics(log, station.task, settings))
    metrics.update(press_metrics(log))
    metrics.update(guidance_metrics(log))
    metrics.update(guide_metrics(log))
    metrics.update(limit_metrics(log))
    metrics.update(_guidance_audit(log, settings))
    metrics.update(teleoperation_metrics(log, settings))
    metrics.update(mounting_metrics(log))
    metrics.update(holder_metrics(log, settings.reference.dwell))
    metrics.update(stream_metrics(log))
    metrics.update(obstacle_metrics(log, settings.obstacles))
    metrics.update(friction_metrics(log))
    metrics.update(shape_metrics(station.task.shape, station.task.fit))
    limits = DriveLimitsOfRun.of(station.robot)
    metrics.update(limits.metrics(log))
    metrics.update(rest_metrics(log, converged_after(settings, log)))
    stop = ""
    if "fault_time" in log.attributes and log.time.size:
        motion_after = MotionAfterFault(log, limits)
        metrics.update(motion_after.metrics())
        stop = motion_after.sentence()
    metrics.update(found_links_metrics(log))
    metrics.update(link_metrics(log))
    metrics.update(plan_metrics(station.task.drive_plan))
    metrics.update(given_metrics(log, station.task.drive_plan))
    metrics.update(posture_metrics(log, station.task.lap))
    metrics.add("real_time_factor", result.real_time_factor)
    median, p99 = np.percentile(tick, [50, 99]) if len(tick) else (np.nan, np.nan)
    metrics.add("controller_tick_us", float(median))
    metrics.add("controller_tick_us_p99", float(p99))
    if analysis is not None:
        metrics.update({f"margins_{name}": m for name, m in metrics_of(analysis).items()})
    set_promises(metrics, settings)
    lasted = end > settings.judged_after - 1.5 * settings.controller.sampling_time
    if result.fault is not None or not lasted:
        leave_unjudged(metrics, fault=result.fault is not None)
    results.write("metrics.json", metrics.to_json())
    warnings = [
        *prepared.warnings,
        *limits.warnings(log),
        *saturation_warnings(log),
        *rate_warnings(log, station.task.drive_plan, settings.reference),
        *_sensor_warnings(log),
        *handle_warnings(log, settings),
        *guidance_warnings(log, settings),
        *unpromised_distance(metrics, settings.controller.law),
    ]
    return _Measured(
        log, motion, metrics, warnings, result.fault, broken_promises(metrics), end, stop
    )


def converged_after(settings: Scenario, log: RunLog) -> float:
    """Return the time from which deviations count [s]: until then the tool comes to the path.

    Where it waits for obstacles its approach waits, too, by the time that is lost.

    Args:
        settings: Scenario of the run.
        log: Its log.
    """
    begin = max(settings.reference.dwell, settings.start.transition)
    if "time_lost" not in log:
        return begin
    there = log.time[log.time - log["time_lost"].values[:, 0] >= begin]
    return float(there[0]) if there.size else np.inf


def _guidance_audit(log: RunLog, settings: Scenario) -> Metrics:
    """Check what was promised of forbidden regions, if there were any."""
    fixtures = settings.fixtures
    if fixtures is None or "near_regions" not in log:
        return Metrics()
    motion = free_motion(settings.compliance, settings.controller.sampling_time)
    guidance = fixtures.guidance
    guides = tuple((guide.stiffness, guide.reach) for guide in fixtures.guides)
    damping = motion.damping if settings.operator is None else None
    numbers = motion.mass, damping, guidance.largest_speed, guidance.tank.capacity, guides
    return audit(log, GuidanceRules(*numbers))


def _sensor_warnings(log: RunLog) -> list[str]:
    """Return what there is to say about a force sensor that was never of use."""
    if "tared" not in log or log["tared"].values.any() or not log.time.size:
        return []
    return [
        "the force/torque sensor was never tared: what should yield has rested, and no metric of "
        "compliance counts; its residual did not rest within sensor.taring_spread for "
        "sensor.taring_time, or its mean was above sensor.taring_bias"
    ]


def _report(
    run: FinishedRun,
    measured: _Measured,
    results: ResultsFolder,
    recording: Path | None,
    drawn: bool,
    interrupted: bool,
) -> Report:
    """Draw figures if wanted, and write the page that a person opens."""
    prepared, task = run.prepared, run.prepared.station.task
    pictures = render_figures(measured.log, drawing_of(task).outline(), task.fit) if drawn else []
    page = report_page(
        title=run.name,
        description=prepared.settings.description,
        warnings=measured.warnings,
        scenario_yaml_text=prepared.text,
        metrics=measured.metrics,
        figures=pictures,
        log_attributes=measured.log.attributes,
        recording=_link(recording, results.path),
        fault=measured.fault,
        broken=measured.broken,
        interrupted=interrupted,
        kind="Simulation run" if run.simulated else "Robot driven",
        diagram_svg=block_diagram_svg(prepared.station.diagram) if pictures else None,
    )
    return write_report(results, pictures, page)


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
