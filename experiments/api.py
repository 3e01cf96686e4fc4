"""Runs and margins from scripts and notebooks, as the command line makes them."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from diagrams.scenario import Scenario
from experiments.calls import only_own_words, read_given, result_folder, shown_progress
from experiments.kept_run import Run
from experiments.preparation import naming
from experiments.simulated_run import RunOptions, run_scenario
from experiments.studies.margins.analysis import analyse
from experiments.studies.margins.box import ErrorBox
from experiments.studies.margins.told import Margins
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.typed import load_typed


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
    with result_folder(out) as folder, only_own_words():
        with shown_progress(loaded.name, duration, quiet) as progress:
            outcome = run_scenario(
                loaded,
                out=folder.path,
                options=RunOptions(duration, after_fault, figures=figures, recording=recording),
                progress=progress,
            )
        return folder.run_of(outcome)


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
