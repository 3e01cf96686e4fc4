"""From a scenario to a robot that is driven by it, and to the page of the run."""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pydrake.lcm import DrakeLcm

from diagrams.builder import build_station
from diagrams.integration import Integration
from diagrams.robots.remote_arm import RemoteArm
from diagrams.scenario import Scenario
from diagrams.scenario.schema import driven
from experiments.finished_run import FinishedRun, RunOutcome, steady_clock, write_outcome
from experiments.hardware.check import FOREIGN, check_alone, check_ready, listen
from experiments.hardware.drive import Drive
from experiments.hardware.drive_options import DriveOptions, command_mode
from experiments.hardware.native_project import PRIORITY, check_native, write_native
from experiments.hardware.native_run import Operator, repeat_drive, run_native
from experiments.hardware.slow_motion import move_slowly
from experiments.hardware.statics import StaticCheck, check_statics
from experiments.preparation import PreparedRun, look_at, naming, settle
from experiments.scenario_file import ScenarioFile
from experiments.simulation import SimulationResult
from pfsc_drake.checks import require_between
from pfsc_drake.drivers.driver_rules import check_mode
from pfsc_drake.drivers.link import ControllerEnd, RequestEnd
from pfsc_drake.drivers.remote_values import LARGEST_OVERRIDE, Request
from pfsc_drake.errors import InputError
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.yaml.reading import resolve_files
from pfsc_drake.yaml.typed import dump_typed, load_typed
from reporting.folder import check_folder, open_results
from reporting.interruption import noticed_interruption
from reporting.progress import ProgressListener

_FIRST_STATUS = 5.0  # s
NATIVE = "native"  # folder of a controller in C, beside the results
_LEAST_OVERRIDE = 0.01
# how often who watches is told [s]
_TOLD = 0.05
_MEASURED = "all signals, those of the tool and the path too, follow from what the robot measured"


@dataclass(frozen=True)
class FirstCommand:
    """What a robot would be told first.

    Attributes:
        kind: What it is.
        values: Of each joint, shape (N,).
    """

    kind: str
    values: np.ndarray


def prepare_driven(
    scenario: ScenarioFile,
    duration: float | None,
    *,
    recording: bool,
    progress: ProgressListener,
) -> PreparedRun:
    """Build a scenario's controller for a robot that stands elsewhere.

    Args:
        scenario: The scenario as read.
        duration: How long it drives [s], instead of the scenario's time.
        recording: Whether the motion will be recorded.
        progress: Told what goes on.

    Raises:
        InputError: If the scenario is wrong, or is nothing for a robot elsewhere.
    """
    given = load_typed(Scenario, scenario.data, str(scenario.path))
    folder = scenario.path.parent
    with naming(scenario.path):
        settings, said = driven(given)
        progress(0.0, "building the controller")
        station = build_station(settings, folder, remote=True)
        settle(settings, scenario.name, station, duration, recording=recording)
        drawing, warnings = look_at(settings, folder, station, recording=recording)
    resolve_files(settings, folder)
    text = dump_typed(settings)
    by_robot = Integration("none", station.controller.period, "the robot moves by itself")
    return PreparedRun(settings, text, station, by_robot, drawing, [_MEASURED, *said, *warnings])


def check_scenario(
    scenario: ScenarioFile, end: ControllerEnd, progress: ProgressListener, degrees: float = 0.0
) -> StaticCheck:
    """Compare a robot's torques with those of a scenario's model, at rest and in slow motion.

    Args:
        scenario: The scenario as read.
        end: The link to the robot.
        progress: Told what goes on.
        degrees: How far each joint is moved [deg]; if 0, nothing is sent.

    Raises:
        InputError: If the scenario is wrong, or the robot is another one, silent, or moves.
    """
    progress(0.0, "preparing")
    prepared = prepare_driven(scenario, None, recording=False, progress=progress)
    station = prepared.station
    assert isinstance(station.part, RemoteArm)
    progress(0.0, "listening")
    believed, period = station.part.belief.robot, station.controller.period
    assert isinstance(believed, SerialChain)
    status = listen(end, period)
    if not degrees:
        return check_statics(believed, status.q[None], status.torque[None])
    mode = command_mode(station)
    check_mode(mode, end.dialect.modes, end.dialect.name)
    check_ready(status, mode, believed.dimension)
    check_alone(end)
    with steady_clock(), noticed_interruption() as interrupted, real_time_priority():
        moved = move_slowly(end, believed, status, degrees, mode, period, interrupted, progress)
    # friction bears what it likes of a load at rest, where something moved instead
    at_rest = status.torque * (np.nan if len(moved.q) else 1.0)
    q, torque = np.vstack([status.q, moved.q]), np.vstack([at_rest, moved.torque])
    found = check_statics(believed, q, torque)
    measured = np.vstack([status.torque, moved.torque])
    return replace(found, measured=measured, complaint=moved.complaint)


def drive_scenario(
    scenario: ScenarioFile,
    end: ControllerEnd,
    *,
    out: Path,
    duration: float | None,
    figures: bool,
    recording: bool,
    progress: ProgressListener,
    dry_run: Callable[[FirstCommand], None] | None = None,
    override: float = 1.0,
    asked: Callable[[float], list[Request]] = lambda _: [],
    native: bool = False,
) -> RunOutcome | None:
    """Drive a robot by a scenario, and write everything that a run leaves into a folder.

    Args:
        scenario: The scenario as read.
        end: The link to the robot.
        out: Folder for the results.
        duration: How long it drives [s], instead of the scenario's time.
        figures: Whether to draw figures.
        recording: Whether to record the motion.
        progress: Told how far it is.
        dry_run: Told the first command in place of the robot; nothing is sent or written then.
        override: Share of its planned pace at which the reference moves at first.
        asked: Returns what a person has asked for since the last time, given the override.
        native: Whether the controller is to do it in C.

    Returns:
        What the run left; None of a dry run.

    Raises:
        InputError: If the scenario or the robot is wrong; nothing has been sent then.
    """
    require_between("--override", override, _LEAST_OVERRIDE, LARGEST_OVERRIDE, "")
    progress(0.0, "preparing")
    inputs = scenario.inputs()
    if dry_run is None:
        check_folder(out, "run", inputs)
    address = check_native(end, out / NATIVE) if native else None
    prepared = prepare_driven(scenario, duration, recording=recording, progress=progress)
    station, options = prepared.station, DriveOptions()
    if native and station.leader is not None:
        raise InputError("--native: a controller in C hears no leader; allowed: a drive without it")
    drive = Drive(station, end, options, override)
    if drive.override != override:
        prepared.warnings.append(
            f"the override is {drive.override:.0%}, not {override:.0%}: the drives can do no more"
        )
    check_mode(drive.mode, end.dialect.modes, end.dialect.name)
    progress(0.0, "waiting for the robot")
    status = end.receive(_FIRST_STATUS)
    if status is None:
        raise InputError(
            f"no status of a robot on {end.dialect.status_channel} within {_FIRST_STATUS:g} s; "
            "is its driver running, on the same --lcm and --driver?"
        )
    check_alone(end)
    first = drive.begin(status)
    if dry_run is not None:
        dry_run(FirstCommand(drive.mode.name or "", first))
        return None
    project, url = None, ""
    if address is not None:
        project = write_native(scenario, prepared, drive, options, end.dialect, out / NATIVE)
        project.compile(progress)
        url = end.lcm.get_lcm_url()
        end.leave()
    with noticed_interruption() as interrupted, open_results(out, "run", inputs) as results:
        results.write("scenario.yaml", prepared.text)
        progress.expect(prepared.settings.duration)
        attributes = {"driven": f"over LCM, {end.dialect.name}"}
        duration, further = prepared.settings.duration, drive.record.add_to
        if project is None or address is None:
            with steady_clock(), real_time_priority():
                result = run_drive(drive, end, options, duration, interrupted, progress, asked)
            if end.foreign:
                count = f"{end.foreign} commands on {end.dialect.command_channel}"
                prepared.warnings.append(f"{FOREIGN}: {count} were not sent by this controller")
        else:
            operator = Operator(
                RequestEnd(DrakeLcm(url)), asked, drive.override, drive.fastest_pace
            )
            left = run_native(project, address, duration, interrupted, progress, operator)
            repeated = repeat_drive(
                left,
                lambda gone: Drive(station, gone, options, override),
                end.dialect,
                options,
                progress,
            )
            result, further = repeated.result, repeated.add_to
            attributes["driven"] += ", by the controller in C"
            prepared.warnings.extend([*left.said, *repeated.comparison.warnings])
        run = FinishedRun(
            prepared,
            scenario.name,
            result,
            attributes=attributes,
            further=further,
            simulated=False,
        )
        return write_outcome(
            run, results, progress, interrupted, figures=figures, recording=recording
        )


def run_drive(
    drive: Drive,
    end: ControllerEnd,
    options: DriveOptions,
    duration: float,
    interrupted: Callable[[], bool],
    progress: Callable[[float, str], None],
    asked: Callable[[float], list[Request]] = lambda _: [],
) -> SimulationResult:
    """Drive a robot until the end, a fault, or an interruption, after each of which it rests.

    Args:
        drive: The controller, whose first status has been checked.
        end: The link.
        options: What it allows itself.
        duration: How long, in the time of the motion as planned [s]: a pause makes it longer.
        interrupted: Whether to stop.
        progress: Told how far it is.
        asked: Returns what a person has asked for since the last time, given the override.
    """
    end.receive(0.0)  # what came while nobody listened
    begin, last = time.perf_counter(), 0.0
    status = end.receive(options.silence)
    if status is not None:
        drive.begin(status)
    while drive.motion_time < duration + 0.5 * drive.period and not drive.has_ended:
        for request in [*end.requests(), *asked(drive.override)]:
            drive.heed(request)
        if interrupted():
            drive.stop("interrupted")
        if end.foreign:
            drive.stop(FOREIGN)
        if status is None:
            drive.lose(f"no status of the robot for {1e3 * options.silence:.0f} ms")
            break
        drive.answer(status)
        if drive.time - last > _TOLD:
            last = drive.time
            end.tell(status.utime, drive.progress())
            progress(drive.motion_time, f"driving at {drive.override:.0%}")
        status = end.receive(options.silence)
    end.tell(0, drive.progress() | {"ended": 1.0})
    return drive.result(time.perf_counter() - begin)


@contextmanager
def real_time_priority() -> Iterator[bool]:
    """Let this process go before others, where that is allowed; tell whether it is."""
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
        allowed = True
    except OSError:
        allowed = False
    try:
        yield allowed
    finally:
        with suppress(OSError):
            os.sched_setscheduler(0, *before)
