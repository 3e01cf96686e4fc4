"""Runs, margins and driven robots from scripts and notebooks, as of the command line."""

import logging
import math
import shutil
import tempfile
import warnings
import weakref
from collections.abc import Callable, Iterator, Mapping
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
from experiments.kept_run import Run, load
from experiments.preparation import naming
from experiments.scenario_file import ScenarioFile, apply_change, expand_home, read_scenario
from experiments.simulated_run import RunOptions, run_scenario
from experiments.studies.margins.analysis import analyse
from experiments.studies.margins.box import ErrorBox
from experiments.studies.margins.margins_page import Margins
from pfsc_drake.drivers.link import ControllerEnd
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
    """Run a scenario, and return what it left.

    A fault ends a run but is no exception: ``fault`` says which it was, and what was logged until
    then is there.

    Args:
        scenario: Name of a shipped scenario, path of a YAML file, or a scenario as made in Python,
            whose relative names of files start in the current folder.
        changes: Values by ``key.path``, as of ``--set`` of the command line; text is read as YAML.
        duration: Simulated time [s] instead of the scenario's.
        out: Folder for the results, a new one or that of an earlier run, which are replaced; None
            for a temporary one that is gone with what is returned, see :meth:`Run.save`.
        figures: Whether to draw figures.
        recording: Whether to record the motion.
        after_fault: How long to go on after a fault [s].
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
    loaded = read_given(scenario, changes or {})
    with only_own_words(), shown_progress(loaded.name, duration, quiet) as progress:
        return keep_run(
            out,
            lambda folder: run_scenario(
                loaded,
                out=folder,
                options=RunOptions(duration, after_fault, figures=figures, recording=recording),
                progress=progress,
            ),
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
    """Tell what the sampled loop of a scenario bears, before anything moves.

    Args:
        scenario: As of :func:`run`.
        changes: As of :func:`run`.
        mass: Relative error of masses and inertias to be borne.
        stiffness: Relative error of joint stiffnesses to be borne.
        rotor: Relative error of rotor inertias to be borne.
        tool: Error of the tool's mass to be borne [kg].
        quiet: Whether to show no progress.

    Raises:
        InputError: If the scenario or an argument is wrong; one line.
    """
    loaded, box = read_given(scenario, changes or {}), ErrorBox(mass, stiffness, rotor, tool)
    with only_own_words(), shown_progress(loaded.name, None, quiet, paced=False) as progress:
        settings = load_typed(Scenario, loaded.data, str(loaded.path))
        with naming(loaded.path):
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
    """Drive a robot by a scenario, and return what the run left. This is no safety function.

    An interruption (Ctrl-C, or the notebook's) brings the robot to rest.

    Args:
        scenario: As of :func:`run`.
        changes: As of :func:`run`.
        lcm: URL of the LCM bus; empty for LCM's default.
        driver: Whose messages the robot understands, ``panda`` or ``iiwa``.
        duration: How long it is driven [s], instead of the scenario's time.
        override: Share of its planned pace at which the reference moves, 0.01 to 1.5.
        native: Whether the controller drives in C, compiled with gcc first.
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
    loaded = read_given(scenario, changes or {})
    options = DriveOptions(duration, override, native, figures, recording)
    end = _link(lcm, driver)
    with only_own_words(), shown_progress(loaded.name, duration, quiet) as progress:
        return keep_run(out, lambda folder: drive_scenario(loaded, end, folder, options, progress))


def first_command(
    scenario: str | Path | Scenario,
    changes: Mapping[str, Any] | None = None,
    *,
    lcm: str = "",
    driver: str = "panda",
    quiet: bool = False,
) -> FirstCommand:
    """Return what a robot would be told first, once it is the scenario's, at rest at its start.

    Nothing is sent.

    Args:
        scenario: As of :func:`run`.
        changes: As of :func:`run`.
        lcm: As of :func:`drive`.
        driver: As of :func:`drive`.
        quiet: Whether to show no progress.

    Raises:
        InputError: If the scenario is wrong, or the robot is another one, silent, or moves.
    """
    loaded, options = read_given(scenario, changes or {}), DriveOptions(recording=False)
    end = _link(lcm, driver)
    with only_own_words(), shown_progress(loaded.name, None, quiet, paced=False) as progress:
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
        move: How far each joint is moved, slowly, 0.5 to 20 [deg]; 0 to send nothing.
        lcm: As of :func:`drive`.
        driver: As of :func:`drive`.
        quiet: Whether to show no progress.

    Raises:
        InputError: If the scenario is wrong, or the robot is another one, silent, or moves.
    """
    loaded = read_given(scenario, changes or {})
    end = _link(lcm, driver)
    with only_own_words(), shown_progress(loaded.name, None, quiet, paced=False) as progress:
        return check_scenario(loaded, end, progress, move)


def _link(lcm: str, driver: str) -> ControllerEnd:
    """Return a link to a robot; the thread of LCM that hears goes before others, where allowed."""
    messages = dialect(driver)
    with real_time_priority():
        return ControllerEnd(open_bus(lcm), messages)


def read_given(scenario: str | Path | Scenario, changes: Mapping[str, Any]) -> ScenarioFile:
    """Return a scenario with changes.

    Args:
        scenario: Name of a shipped scenario, path of a YAML file, or one as made in Python.
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
        apply_change(loaded.data, key, value)
    return loaded


def keep_run(out: str | Path | None, make: Callable[[Path], RunOutcome]) -> Run:
    """Make a run in a folder, and return it.

    Args:
        out: The folder; None for a temporary one, which goes with the run that is returned, and
            where nothing comes of it.
        make: Makes the run in a folder, and returns how it ended.

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
    """Return what shows progress here.

    Args:
        title: Name of what goes on.
        duration: Simulated time [s], if it is known.
        quiet: Whether to show nothing.
        paced: Whether there is a simulated time.
    """
    if quiet:
        return nullcontext(NoProgress())
    if in_notebook():
        return NotebookProgress(title)
    return ProgressDisplay(Console(), title, duration, paced=paced)


@contextmanager
def only_own_words() -> Iterator[None]:
    """Let libraries be silent: what matters is in the outcome, in words of its own."""
    drake = logging.getLogger("drake")
    level = drake.level
    drake.setLevel(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        drake.setLevel(level)
