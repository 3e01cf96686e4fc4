"""One run: from a scenario file to log, metrics, figures, recording and report."""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.geometry import Meshcat, MeshcatParams

from diagrams.builder import build_station_replay
from diagrams.drawing.block_diagram import block_diagram_svg
from diagrams.drawing.replay import RecordedMotion, record
from diagrams.scenario import Scenario
from diagrams.wording import posture_text
from experiments.catalog.scenario_file import ScenarioFile
from experiments.figures.all import render_figures
from experiments.preparation import PreparedRun, prepare
from experiments.results.friction_metrics import friction_metrics
from experiments.results.guidance_audit import Promise, audit
from experiments.results.guidance_metrics import guidance_metrics
from experiments.results.joint_limits import JointLimits
from experiments.results.link_signals import lap_length
from experiments.results.path_metrics import path_following_metrics
from experiments.results.posture_metrics import posture_metrics
from experiments.results.press_metrics import press_metrics
from experiments.results.recorded_motion import collect_motion
from experiments.results.run_log import RunLog
from experiments.results.run_signals import collect_log
from experiments.results.shape_metrics import shape_metrics
from experiments.results.tick import measure_tick
from experiments.simulation import simulate
from experiments.studies.margins.analysis import MarginAnalysis, analyse
from experiments.studies.margins.box import Box
from experiments.studies.margins.words import metrics_of, one_line
from reporting.folder import ResultsFolder, check_folder, open_results
from reporting.interruption import noticed_interruption
from reporting.metrics import Metrics
from reporting.page import Report, report_page, write_report
from reporting.progress import ProgressListener
from reporting.provenance import standard_attributes

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
    """

    fault: str | None
    report: Path | None
    metrics: Metrics
    warnings: list[str]
    interrupted: bool = False
    problem: str | None = None
    margins: str | None = None


@dataclass(frozen=True)
class _Measured:
    """What was measured of a run.

    Attributes:
        log: All signals.
        motion: What a recording needs of them.
        metrics: Metrics with their targets.
        warnings: What may not have gone as well as hoped, one sentence each.
        fault: Why the run was stopped, or None.
        end: When it ended [s].
    """

    log: RunLog
    motion: RecordedMotion
    metrics: Metrics
    warnings: list[str]
    fault: str | None
    end: float


def run_scenario(
    scenario: ScenarioFile,
    *,
    out: Path,
    duration: float | None,
    figures: bool,
    recording: bool,
    progress: ProgressListener,
    margins: bool = False,
    after_fault: float = 0.0,
) -> RunOutcome:
    """Run a scenario and write everything that a run leaves into a folder.

    Args:
        scenario: The scenario as read.
        out: Folder for the results, see :func:`reporting.folder.open_results`.
        duration: Simulated time [s] instead of the scenario's.
        figures: Whether to draw figures.
        recording: Whether to record the motion.
        progress: Told how far the run is.
        margins: Whether to tell the margins of the loop at the start.
        after_fault: How long to go on after a fault [s], so that one sees how it ends.

    Raises:
        InputError: If the scenario is wrong or the folder cannot be used; nothing has moved then.
    """
    progress(0.0, "preparing")
    inputs = scenario.inputs()
    check_folder(out, "run", inputs)
    prepared = prepare(scenario, duration, recording=recording, progress=progress)
    analysis = _analyse(prepared, scenario.path.parent, progress) if margins else None
    with noticed_interruption() as interrupted, open_results(out, "run", inputs) as results:
        results.write("scenario.yaml", prepared.text)
        measured = _measure(
            prepared, scenario.name, results, progress, interrupted, analysis, after_fault
        )
        page = None
        if recording and len(measured.motion.times) > 1 and not interrupted():
            progress(measured.end, "recording")
            page = results.write("recording.html", _recording(prepared, measured.motion))
        drawn = figures and not interrupted()
        if drawn:
            progress(measured.end, "drawing")
        report = _report(prepared, scenario.name, measured, results, page, drawn, interrupted())
        progress(measured.end, "done")
        return RunOutcome(
            measured.fault,
            report.path,
            measured.metrics,
            measured.warnings,
            interrupted(),
            report.problem,
            None if analysis is None else one_line(analysis),
        )


def _analyse(prepared: PreparedRun, folder: Path, progress: ProgressListener) -> MarginAnalysis:
    """Tell the margins of the loop at the start."""
    return analyse(prepared.settings, folder, Box(), _BeforeStart(progress), only_start=True)


class _BeforeStart:
    """Tells what goes on before the run's own time begins."""

    def __init__(self, progress: ProgressListener) -> None:
        self._progress = progress

    def expect(self, duration: float) -> None:
        """Leave it to the run."""

    def __call__(self, simulated_time: float, phase: str) -> None:
        self._progress(0.0, phase)


def _measure(
    prepared: PreparedRun,
    name: str,
    results: ResultsFolder,
    progress: ProgressListener,
    interrupted: Callable[[], bool],
    analysis: MarginAnalysis | None,
    after_fault: float,
) -> _Measured:
    """Simulate, and write the log and the metrics."""
    settings, station = prepared.settings, prepared.station
    progress.expect(settings.duration)
    with _steady_clock():
        result = simulate(
            station, settings.simulation, settings.duration, progress, interrupted, after_fault
        )
        end = float(result.root.get_time())
        log = collect_log(station, result.root)
        log["rcond"].limits = np.array([[settings.controller.min_rcond, np.inf]])
        log.attributes = standard_attributes(name) | {
            "integration": str(prepared.integration),
            "start_posture": posture_text(station.robot, station.start_posture),
        }
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
    # the tool comes to the path during the first rest; from then on deviations count
    metrics = path_following_metrics(
        log, settings.settling_tolerance, settings.reference.dwell, _MOVING
    )
    metrics.update(press_metrics(log))
    metrics.update(guidance_metrics(log))
    metrics.update(_guidance_audit(log, settings))
    metrics.update(friction_metrics(log))
    metrics.update(shape_metrics(station.task.shape, station.task.fit))
    limits = JointLimits.of(station.robot)
    metrics.update(limits.metrics(log))
    metrics.update(posture_metrics(log, lap_length(station)))
    metrics.add("real_time_factor", result.real_time_factor, "1")
    median, p99 = np.percentile(tick, [50, 99]) if len(tick) else (np.nan, np.nan)
    metrics.add("controller_tick_us", float(median), "us", source="median")
    metrics.add("controller_tick_us_p99", float(p99), "us")
    if analysis is not None:
        metrics.update({f"margins_{name}": m for name, m in metrics_of(analysis).items()})
    for metric, target in settings.targets.get(settings.controller.law, {}).items():
        # what another choice of the controller would tell has been checked, and is no metric here
        if metric in metrics:
            metrics.set_target(metric, target.bound, target.source)
    results.write("metrics.json", metrics.to_json())
    warnings = [*prepared.warnings, *limits.warnings(log), *_sensor_warnings(log)]
    return _Measured(log, motion, metrics, warnings, result.fault, end)


def _guidance_audit(log: RunLog, settings: Scenario) -> Metrics:
    """Check what was promised of forbidden regions, if there were any."""
    fixtures, along = settings.fixtures, settings.compliance.tangential
    if fixtures is None or fixtures.guidance.rules != "program" or "near_regions" not in log:
        return Metrics()
    guidance = fixtures.guidance
    return audit(
        log,
        Promise(
            along.mass.value, along.damping.value, guidance.largest_speed, guidance.tank.capacity
        ),
    )


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
    prepared: PreparedRun,
    name: str,
    measured: _Measured,
    results: ResultsFolder,
    recording: Path | None,
    drawn: bool,
    interrupted: bool,
) -> Report:
    """Draw figures if wanted, and write the page that a person opens."""
    task = prepared.station.task
    pictures = render_figures(measured.log, task.drawing.outline(), task.fit) if drawn else []
    page = report_page(
        title=name,
        description=prepared.settings.description,
        warnings=measured.warnings,
        scenario_yaml_text=prepared.text,
        metrics=measured.metrics,
        figures=pictures,
        log_attributes=measured.log.attributes,
        recording=_link(recording, results.path),
        fault=measured.fault,
        interrupted=interrupted,
        diagram_svg=block_diagram_svg(prepared.station.diagram) if pictures else None,
    )
    return write_report(results, pictures, page)


def _recording(prepared: PreparedRun, motion: RecordedMotion) -> str:
    """Return the recording as a page of its own."""
    meshcat, settings = Meshcat(MeshcatParams(host="localhost")), prepared.settings
    diagram = build_station_replay(settings, prepared.station, prepared.drawing, motion, meshcat)
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
