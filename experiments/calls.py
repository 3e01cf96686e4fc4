"""Functions for scripts and notebooks: runs, margins and driven robots."""

import logging
import math
import shutil
import tempfile
import warnings
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Any

from rich.console import Console

from diagrams.scenario import Scenario
from experiments.command_options import open_bus
from experiments.finished_run import RunOutcome
from experiments.hardware.driven_run import (
    DriveOptions,
    FirstCommand,
    drive_scenario,
    real_time_priority,
)
from experiments.hardware.driven_run import first_command as ask_first_command
from experiments.hardware.slow_motion import check_scenario
from experiments.hardware.statics import StaticCheck
from experiments.new_scenario.first_scenario import InitOptions
from experiments.new_scenario.new_scenario import NewScenario, create_scenario, new_file
from experiments.preparation import naming
from experiments.saved_run import Run, load
from experiments.scenario_file import ScenarioFile, expand_home, read_scenario
from experiments.simulated_run import RunOptions, run_scenario
from experiments.studies.margins.analysis import analyse
from experiments.studies.margins.box import ErrorBox
from experiments.studies.margins.margins_page import Margins
from pfsc_drake.drivers.link import ControllerEndpoint
from pfsc_drake.drivers.messages import dialect
from pfsc_drake.errors import InputError, WriteError
from pfsc_drake.yaml.dumping import typed_data
from pfsc_drake.yaml.typed import load_typed
from reporting.notebook import NotebookProgress, in_notebook
from reporting.progress import NoProgress, ProgressDisplay


def run(
    scenario: str | Path | Scenario,
    changes: Mapping[str, Any] | None = None,
    *,
    duration: float | None = None,
    out: str | Path | None = None,
    figures: bool = True,
    recording: bool = True,
    after_fault: float = 0.0,
    quiet: bool = False,
) -> Run:
    """Run a scenario, and return its results.

    A fault ends a run but raises no exception: ``fault`` names it, and the log up to then is
    available.

    Args:
        scenario: Name of a shipped scenario, path of a YAML file, or a scenario created in Python,
            whose relative file names start in the current folder.
        changes: Values by ``key.path``, as for ``--set`` on the command line; text is read as YAML.
        duration: Simulated time [s] instead of the scenario's.
        out: Folder for the results; results of an earlier run are replaced. None for a temporary
            folder, deleted with the returned run, see :meth:`Run.save`.
        figures: Whether to draw figures.
        recording: Whether to record the motion.
        after_fault: Simulated time after a fault [s].
        quiet: Whether to show no progress.

    Raises:
        InputError: If the scenario or an argument is wrong; one line, and nothing has moved then.
        WriteError: If results could not be written.
    """
    for name, time, least in (("duration", duration, False), ("after_fault", after_fault, True)):
        good = time is None or (math.isfinite(time) and (time > 0.0 or (least and time == 0.0)))
        if not good:
            allowed = "a number of seconds, 0 or more" if least else "a positive number of seconds"
            raise InputError(f"{name} = {time}; allowed: {allowed}")
    loaded = resolve_scenario(scenario, changes or {})
    with quiet_libraries(), shown_progress(loaded.name, duration, quiet) as progress:
        return run_in_folder(
            out,
            lambda folder: run_scenario(
                loaded,
                out=folder,
                options=RunOptions(duration, after_fault, figures=figures, recording=recording),
                progress=progress,
            ),
        )


def init(
    model: str | Path,
    points: str | Path,
    out: str | Path | None = None,
    *,
    tool_frame: str = "",
    law: str = "",
    unit: str = "",
    orientation: str = "",
    base_position: Sequence[float] = (),
    replace: bool = False,
    quiet: bool = False,
) -> NewScenario:
    """Write a scenario that runs, for a robot model and points; return its choices and deviations.

    Options that are left out are chosen from the data of model and points. A trial run checks the
    scenario before it is written.

    Args:
        model: URDF, SDF or MJCF file, or the name of a shipped model.
        points: CSV file with columns x, y, z and more.
        out: YAML file to write; None for MODEL_POINTS.yaml in the current folder.
        tool_frame: Frame of the model that follows the points.
        law: Control law, e.g. ``"rigid"``.
        unit: Unit of the points, e.g. ``"mm"``.
        orientation: Direction of the tool's z axis if the file has none: ``"down"``, ``"forward"``,
            ``"up"``; ``"free"`` for the position alone.
        base_position: Position of the robot's base in the world [m], three numbers.
        replace: Whether an existing file is replaced.
        quiet: Whether to show no progress.

    Raises:
        InputError: If model or points cannot be read, or do not suit each other; one line, and
            nothing has been written then.
    """
    base = tuple(float(value) for value in base_position)
    if len(base) not in (0, 3) or not all(map(math.isfinite, base)):
        raise InputError(f"base_position = {list(base)}; allowed: three numbers in m")
    file = new_file(str(model), str(points), out, replace=replace)
    options = InitOptions(tool_frame, law, unit, orientation, base)
    with quiet_libraries(), shown_progress(file.stem, None, quiet) as progress:
        return create_scenario(
            str(model), str(points), file, options, progress=progress, replace=replace
        )


def margins(
    scenario: str | Path | Scenario,
    changes: Mapping[str, Any] | None = None,
    *,
    mass: float = 0.05,
    stiffness: float = 0.05,
    rotor: float = 0.0,
    tool: float = 0.1,
    quiet: bool = False,
) -> Margins:
    """Compute stability margins of a scenario's sampled loop, before anything moves.

    Args:
        scenario: As of :func:`run`.
        changes: As of :func:`run`.
        mass: Relative error of masses and inertias to tolerate.
        stiffness: Relative error of joint stiffnesses to tolerate.
        rotor: Relative error of rotor inertias to tolerate.
        tool: Error of the tool's mass to tolerate [kg].
        quiet: Whether to show no progress.

    Raises:
        InputError: If the scenario or an argument is wrong; one line.
    """
    loaded, box = resolve_scenario(scenario, changes or {}), ErrorBox(mass, stiffness, rotor, tool)
    with quiet_libraries(), shown_progress(loaded.name, None, quiet, paced=False) as progress:
        settings = load_typed(Scenario, loaded.data, loaded.source)
        with naming(loaded.source):
            return Margins(loaded.name, analyse(settings, loaded.path.parent, box, progress))


def drive(
    scenario: str | Path | Scenario,
    changes: Mapping[str, Any] | None = None,
    *,
    lcm: str = "",
    driver: str = "panda",
    duration: float | None = None,
    override: float = 1.0,
    native: bool = False,
    out: str | Path | None = None,
    figures: bool = True,
    recording: bool = True,
    quiet: bool = False,
) -> Run:
    """Drive a robot by a scenario, and return the run's results. This is no safety function.

    An interruption (Ctrl-C, or the notebook's) brings the robot to rest.

    Args:
        scenario: As of :func:`run`.
        changes: As of :func:`run`.
        lcm: URL of the LCM bus; empty for LCM's default.
        driver: Message set of the robot's driver, ``panda`` or ``iiwa``.
        duration: Duration of the motion [s] instead of the scenario's.
        override: Speed scaling of the reference, 0.01 to 1.5.
        native: Whether the controller runs as C code, compiled with gcc first.
        out: Folder for the results; None for a temporary one, see :func:`run`.
        figures: Whether to draw figures.
        recording: Whether to record the motion.
        quiet: Whether to show no progress.

    Raises:
        InputError: If the scenario or the robot is wrong; one line, and nothing has been sent then.
        WriteError: If results could not be written.
    """
    if duration is not None and not (math.isfinite(duration) and duration > 0.0):
        raise InputError(f"duration = {duration}; allowed: a positive number of seconds")
    loaded = resolve_scenario(scenario, changes or {})
    options = DriveOptions(duration, override, native, figures, recording)
    end = _link(lcm, driver)
    with quiet_libraries(), shown_progress(loaded.name, duration, quiet) as progress:
        return run_in_folder(
            out, lambda folder: drive_scenario(loaded, end, folder, options, progress)
        )


def first_command(
    scenario: str | Path | Scenario,
    changes: Mapping[str, Any] | None = None,
    *,
    lcm: str = "",
    driver: str = "panda",
    quiet: bool = False,
) -> FirstCommand:
    """Check the robot, and return the first command that it would receive.

    The robot must be the scenario's, at rest at its start. Nothing is sent.

    Args:
        scenario: As of :func:`run`.
        changes: As of :func:`run`.
        lcm: As of :func:`drive`.
        driver: As of :func:`drive`.
        quiet: Whether to show no progress.

    Raises:
        InputError: If the scenario is wrong, or the robot is a different one, silent, or moving.
    """
    loaded, options = resolve_scenario(scenario, changes or {}), DriveOptions(recording=False)
    end = _link(lcm, driver)
    with quiet_libraries(), shown_progress(loaded.name, None, quiet, paced=False) as progress:
        return ask_first_command(loaded, end, Path(), options, progress)


def check_robot(
    scenario: str | Path | Scenario,
    changes: Mapping[str, Any] | None = None,
    *,
    move: float = 0.0,
    lcm: str = "",
    driver: str = "panda",
    quiet: bool = False,
) -> StaticCheck:
    """Compare a robot's torques with those of a scenario's model.

    Args:
        scenario: As of :func:`run`.
        changes: As of :func:`run`.
        move: Amplitude of a slow motion of each joint, 0.5 to 20 [deg]; 0 to send nothing.
        lcm: As of :func:`drive`.
        driver: As of :func:`drive`.
        quiet: Whether to show no progress.

    Raises:
        InputError: If the scenario is wrong, or the robot is a different one, silent, or moving.
    """
    loaded = resolve_scenario(scenario, changes or {})
    end = _link(lcm, driver)
    with quiet_libraries(), shown_progress(loaded.name, None, quiet, paced=False) as progress:
        return check_scenario(loaded, end, progress, move)


def _link(lcm: str, driver: str) -> ControllerEndpoint:
    """Return a link to a robot; LCM's receiving thread gets real-time priority if allowed."""
    messages = dialect(driver)
    with real_time_priority():
        return ControllerEndpoint(open_bus(lcm), messages)


def resolve_scenario(scenario: str | Path | Scenario, changes: Mapping[str, Any]) -> ScenarioFile:
    """Read a scenario and apply changes.

    Args:
        scenario: Name of a shipped scenario, path of a YAML file, or a scenario created in Python.
        changes: Values by ``key.path``.

    Raises:
        InputError: If there is none, or no such key.
    """
    if isinstance(scenario, Scenario):
        path = Path.cwd() / f"{scenario.name or 'scenario'}.yaml"
        loaded = ScenarioFile(path, typed_data(scenario))
    else:
        loaded = read_scenario(str(scenario), [])
    for key, value in changes.items():
        loaded.change(key, value)
    return loaded


def run_in_folder(out: str | Path | None, make: Callable[[Path], RunOutcome]) -> Run:
    """Run in a folder, and load the results.

    Args:
        out: The folder; None for a temporary one, deleted with the returned run or after a failure.
        make: Performs the run in a folder, and returns its outcome.

    Raises:
        WriteError: If results could not be written.
    """
    is_temporary = out is None
    folder = expand_home(Path(out or tempfile.mkdtemp(prefix="pfsc_drake_run_")))
    try:
        outcome = make(folder)
        if outcome.problem is not None:
            raise WriteError(outcome.problem)
        result = load(folder)
    except BaseException:
        if is_temporary:
            shutil.rmtree(folder, ignore_errors=True)
        raise
    if is_temporary:
        weakref.finalize(result, shutil.rmtree, str(folder), ignore_errors=True)
    return result


def shown_progress(
    title: str, duration: float | None, quiet: bool, *, paced: bool = True
) -> AbstractContextManager[NotebookProgress | ProgressDisplay | NoProgress]:
    """Return the progress display for a notebook or a terminal.

    Args:
        title: Name of the task.
        duration: Simulated time [s], if it is known.
        quiet: Whether to show nothing.
        paced: Whether the task has a simulated time.
    """
    if quiet:
        return nullcontext(NoProgress())
    if in_notebook():
        return NotebookProgress(title)
    return ProgressDisplay(Console(), title, duration, paced=paced)


@contextmanager
def quiet_libraries() -> Iterator[None]:
    """Silence logs and warnings of libraries; the outcome reports everything relevant."""
    drake = logging.getLogger("drake")
    level = drake.level
    drake.setLevel(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        drake.setLevel(level)
