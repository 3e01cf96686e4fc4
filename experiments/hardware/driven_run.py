"""Runs of a robot driven by a scenario, with results."""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.lcm import DrakeLcm

from diagrams.builder import build_station
from diagrams.integration import Integration
from diagrams.scenario import Scenario
from diagrams.scenario.schema import driven
from experiments.finished_run import FinishedRun, RunOutcome, steady_clock, write_outcome
from experiments.hardware.check import FOREIGN, SILENCE, check_alone
from experiments.hardware.drive import Drive
from experiments.hardware.native_project import PRIORITY, check_native, write_native
from experiments.hardware.native_record import RepeatedDrive
from experiments.hardware.native_run import Operator, run_native
from experiments.preparation import PreparedRun, look_at, naming, settle
from experiments.scenario_file import ScenarioFile
from experiments.simulation import SimulationResult
from pfsc_drake.checks import require_between
from pfsc_drake.drivers.driver_rules import check_mode
from pfsc_drake.drivers.layout import UdpmAddress
from pfsc_drake.drivers.link import ControllerEndpoint, RequestEndpoint
from pfsc_drake.drivers.remote_values import LARGEST_OVERRIDE, Request
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.dumping import dump_typed
from pfsc_drake.yaml.reading import resolve_files
from pfsc_drake.yaml.typed import load_typed
from reporting.folder import check_folder, open_results
from reporting.interruption import watch_interruption
from reporting.progress import ProgressListener

_FIRST_STATUS = 5.0  # s
NATIVE = "native"  # folder of a controller in C, beside the results
_LEAST_OVERRIDE = 0.01
# period of progress messages [s]
_REPORT_PERIOD = 0.05
_MEASURED = "all signals, also of tool and path, are based on the robot's measurements"


@dataclass(frozen=True)
class DriveOptions:
    """Options of a driven run.

    Attributes:
        duration: Duration [s] instead of the scenario's.
        override: Initial speed scaling of the reference, 0.01 to 1.5.
        native: Whether the controller runs as C code, compiled with gcc first.
        figures: Whether to draw figures.
        recording: Whether to record the motion.
    """

    duration: float | None = None
    override: float = 1.0
    native: bool = False
    figures: bool = True
    recording: bool = True

    def __post_init__(self) -> None:
        require_between("--override", self.override, _LEAST_OVERRIDE, LARGEST_OVERRIDE, "")


@dataclass(frozen=True)
class FirstCommand:
    """First command to a robot.

    Attributes:
        kind: Kind of the command.
        values: Value of each joint, shape (N,).
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
    """Build a scenario's controller for a robot in another process.

    Args:
        scenario: The scenario as read.
        duration: Duration [s] instead of the scenario's.
        recording: Whether the motion will be recorded.
        progress: Progress listener.

    Raises:
        InputError: If the scenario is wrong, or not possible for a robot in another process.
    """
    parameters = load_typed(Scenario, scenario.data, scenario.source)
    folder = scenario.path.parent
    with naming(scenario.source):
        settings, messages = driven(parameters)
        progress(0.0, "building the controller")
        station = build_station(settings, folder, remote=True)
        settle(settings, scenario.name, station, duration, recording=recording)
        drawing, warnings = look_at(settings, folder, station, recording=recording)
    resolve_files(settings, folder)
    text = dump_typed(settings)
    by_robot = Integration("none", station.controller.period, "the robot moves by itself")
    return PreparedRun(
        settings, text, station, by_robot, drawing, [_MEASURED, *messages, *warnings]
    )


def _begin(
    scenario: ScenarioFile,
    end: ControllerEndpoint,
    out: Path,
    options: DriveOptions,
    progress: ProgressListener,
) -> tuple[PreparedRun, Drive, np.ndarray, UdpmAddress | None]:
    """Prepare a controller, wait for its robot and check both; nothing is sent.

    Returns:
        The prepared run; the controller; the first command, shape (N,); and the address of the bus
        for a controller in C.
    """
    address = check_native(end, out / NATIVE) if options.native else None
    prepared = prepare_driven(
        scenario, options.duration, recording=options.recording, progress=progress
    )
    station, override = prepared.station, options.override
    if options.native and station.leader is not None:
        raise InputError(
            "--native: not possible with a leader device; allowed: drive without --native"
        )
    drive = Drive(station, end, override)
    if drive.override != override:
        prepared.warnings.append(
            f"the override is limited from {override:.0%} to {drive.override:.0%} by the drives"
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
    return prepared, drive, drive.begin(status), address


def first_command(
    scenario: ScenarioFile,
    end: ControllerEndpoint,
    out: Path,
    options: DriveOptions,
    progress: ProgressListener,
) -> FirstCommand:
    """Return the first command to a robot; nothing is sent or written.

    Args:
        scenario: The scenario as read.
        end: The link to the robot.
        out: Folder for the results of a drive.
        options: Options of the run.
        progress: Progress listener.

    Raises:
        InputError: If the scenario or the robot is wrong.
    """
    progress(0.0, "preparing")
    _, drive, first, _ = _begin(scenario, end, out, options, progress)
    return FirstCommand(drive.mode.name or "", first)


def drive_scenario(
    scenario: ScenarioFile,
    end: ControllerEndpoint,
    out: Path,
    options: DriveOptions,
    progress: ProgressListener,
    requests: Callable[[float], list[Request]] = lambda _: [],
) -> RunOutcome:
    """Drive a robot by a scenario, and write all results into a folder.

    Args:
        scenario: The scenario as read.
        end: The link to the robot.
        out: Folder for the results.
        options: Options of the run.
        progress: Progress listener.
        requests: Returns the operator's requests since the last call, given the override.

    Raises:
        InputError: If the scenario or the robot is wrong; nothing has been sent then.
    """
    progress(0.0, "preparing")
    inputs = scenario.inputs()
    check_folder(out, "run", inputs)
    prepared, drive, _, address = _begin(scenario, end, out, options, progress)
    duration = prepared.settings.duration
    project, url = None, ""
    if address is not None:
        project = write_native(scenario, prepared, drive, end.dialect, out / NATIVE)
        project.compile(progress)
        url = end.lcm.get_lcm_url()
        end.leave()
    with watch_interruption() as interrupted, open_results(out, "run", inputs) as results:
        results.write("scenario.yaml", prepared.text)
        progress.expect(duration)
        by, add_to = f"over LCM, {end.dialect.name}", drive.add_to
        if project is None or address is None:
            with steady_clock(), real_time_priority():
                result = run_drive(drive, end, duration, interrupted, progress, requests)
            if end.foreign:
                count = f"{end.foreign} commands on {end.dialect.command_channel}"
                prepared.warnings.append(f"{FOREIGN}: {count} were not sent by this controller")
        else:
            operator = Operator(
                RequestEndpoint(DrakeLcm(url)), requests, drive.override, drive.largest_scaling
            )
            left = run_native(project, address, duration, interrupted, progress, operator)
            repeated = RepeatedDrive(
                left,
                lambda gone: Drive(prepared.station, gone, options.override),
                end.dialect,
                progress,
            )
            result, add_to = repeated.result, repeated.add_to
            by += ", by the controller in C"
            prepared.warnings.extend([*left.messages, *repeated.warnings])
        run = FinishedRun(
            prepared,
            scenario.name,
            result,
            attributes={"driven": by},
            further=add_to,
            simulated=False,
        )
        return write_outcome(
            run,
            results,
            progress,
            interrupted,
            figures=options.figures,
            recording=options.recording,
        )


def run_drive(
    drive: Drive,
    end: ControllerEndpoint,
    duration: float,
    interrupted: Callable[[], bool],
    progress: Callable[[float, str], None],
    requests: Callable[[float], list[Request]] = lambda _: [],
) -> SimulationResult:
    """Drive a robot until the end, a fault or an interruption, each followed by rest.

    Args:
        drive: The controller, whose first status has been checked.
        end: The link.
        duration: Duration in the time of the planned motion [s]; a pause extends it.
        interrupted: Whether to stop.
        progress: Progress listener.
        requests: Returns the operator's requests since the last call, given the override.
    """
    end.receive(0.0)  # discard old messages
    begin, last = time.perf_counter(), 0.0
    status = end.receive(SILENCE)
    if status is not None:
        drive.begin(status)
    while drive.motion_time < duration + 0.5 * drive.period and not drive.has_ended:
        for request in [*end.requests(), *requests(drive.override)]:
            drive.handle_request(request)
        if interrupted():
            drive.stop("interrupted")
        if end.foreign:
            drive.stop(FOREIGN)
        if status is None:
            drive.lose(f"no status of the robot for {1e3 * SILENCE:.0f} ms")
            break
        drive.answer(status)
        if drive.time - last > _REPORT_PERIOD:
            last = drive.time
            end.publish_progress(status.utime, drive.progress())
            progress(drive.motion_time, f"driving at {drive.override:.0%}")
        status = end.receive(SILENCE)
    end.publish_progress(0, drive.progress() | {"ended": 1.0})
    return drive.result(time.perf_counter() - begin)


@contextmanager
def real_time_priority() -> Iterator[bool]:
    """Give this process real-time priority if allowed, and return whether it is."""
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
