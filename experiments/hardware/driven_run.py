"""From a scenario to a robot that is driven by it, and to the page of the run."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from diagrams.builder import build_station, draw_station
from diagrams.integration import Integration
from diagrams.robots.remote_arm import RemoteArm
from diagrams.scenario import Scenario
from diagrams.scenario.driven import driven
from experiments.finished_run import FinishedRun, RunOutcome, steady_clock, write_outcome
from experiments.hardware.check import RestCheck, check_at_rest, listen
from experiments.hardware.drive import Drive, DriveOptions, run_drive
from experiments.hardware.native_project import PRIORITY, check_native, write_native
from experiments.hardware.native_run import repeat_drive, run_native
from experiments.preparation import PreparedRun, naming, settle
from experiments.scenario_file import ScenarioFile
from pfsc_drake.checks import require_between
from pfsc_drake.drivers.driver_rules import check_mode
from pfsc_drake.drivers.link import ControllerEnd
from pfsc_drake.errors import InputError
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.yaml.reading import resolve_files
from pfsc_drake.yaml.typed import dump_typed, load_typed
from reporting.folder import check_folder, open_results
from reporting.processes import noticed_interruption
from reporting.progress import ProgressListener

_FIRST_STATUS = 5.0  # s
NATIVE = "native"  # folder of a controller in C, beside the results
_LEAST_OVERRIDE, _LARGEST_OVERRIDE = 0.01, 1.5
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
    override: float = 1.0,
) -> PreparedRun:
    """Build a scenario's controller for a robot that stands elsewhere.

    Args:
        scenario: The scenario as read.
        duration: How long it drives [s], instead of the scenario's time.
        recording: Whether the motion will be recorded.
        progress: Told what goes on.
        override: Share of its speed that the reference has: the same motion, slower.

    Raises:
        InputError: If the scenario is wrong, or is nothing for a robot elsewhere.
    """
    require_between("--override", override, _LEAST_OVERRIDE, _LARGEST_OVERRIDE, "")
    given = load_typed(Scenario, scenario.data, str(scenario.path))
    folder = scenario.path.parent
    with naming(scenario.path):
        settings, said = driven(given)
        if override != 1.0:
            settings.reference.velocity *= override
            settings.reference.acceleration *= override**2
            if settings.reference.second is not None:
                settings.reference.second.velocity *= override
                settings.reference.second.acceleration *= override**2
            said.append(f"the reference has {override:.0%} of its speed")
        progress(0.0, "building the controller")
        station = build_station(settings, folder, remote=True)
        settle(settings, scenario.name, station, duration, recording=recording)
        drawing = draw_station(settings, folder, station) if recording else None
    warnings = station.warnings + (drawing.warnings if drawing else [])
    resolve_files(settings, folder)
    text = dump_typed(settings)
    by_robot = Integration("none", station.controller.period, "the robot moves by itself")
    return PreparedRun(settings, text, station, by_robot, drawing, [_MEASURED, *said, *warnings])


def check_scenario(
    scenario: ScenarioFile, end: ControllerEnd, progress: ProgressListener
) -> RestCheck:
    """Compare the torques of a robot at rest with those of a scenario's model; send nothing.

    Args:
        scenario: The scenario as read.
        end: The link to the robot.
        progress: Told what goes on.

    Raises:
        InputError: If the scenario is wrong, or the robot is another one, silent, or moves.
    """
    progress(0.0, "preparing")
    prepared = prepare_driven(scenario, None, recording=False, progress=progress)
    station = prepared.station
    assert isinstance(station.part, RemoteArm)
    progress(0.0, "listening")
    believed = station.part.belief.robot
    assert isinstance(believed, SerialChain)
    return check_at_rest(believed, listen(end, station.controller.period))


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
        override: Share of its speed that the reference has.
        native: Whether the controller is to do it in C.

    Returns:
        What the run left; None of a dry run.

    Raises:
        InputError: If the scenario or the robot is wrong; nothing has been sent then.
    """
    progress(0.0, "preparing")
    inputs = scenario.inputs()
    if dry_run is None:
        check_folder(out, "run", inputs)
    address = check_native(end, out / NATIVE) if native else None
    prepared = prepare_driven(
        scenario, duration, recording=recording, progress=progress, override=override
    )
    station, options = prepared.station, DriveOptions()
    drive = Drive(station, end, options)
    check_mode(drive.mode, end.dialect.modes, end.dialect.name)
    progress(0.0, "waiting for the robot")
    status = end.receive(_FIRST_STATUS)
    if status is None:
        raise InputError(
            f"no status of a robot on {end.dialect.status_channel} within {_FIRST_STATUS:g} s; "
            "is its driver running, on the same --lcm and --driver?"
        )
    first = drive.begin(status)
    if dry_run is not None:
        dry_run(FirstCommand(drive.mode.name or "", first))
        return None
    project = None
    if address is not None:
        project = write_native(scenario, prepared, drive, options, end.dialect, out / NATIVE)
        project.compile(progress)
        end.leave()
    with noticed_interruption() as interrupted, open_results(out, "run", inputs) as results:
        results.write("scenario.yaml", prepared.text)
        progress.expect(prepared.settings.duration)
        attributes = {"driven": f"over LCM, {end.dialect.name}"}
        duration, further = prepared.settings.duration, drive.record.add_to
        if project is None or address is None:
            with steady_clock(), real_time_priority():
                result = run_drive(drive, end, options, duration, interrupted, progress)
        else:
            left = run_native(project, address, duration, interrupted, progress)
            repeated = repeat_drive(
                left, lambda gone: Drive(station, gone, options), end.dialect, options, progress
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
