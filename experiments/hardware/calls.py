"""Robots behind messages, driven from scripts and notebooks."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from diagrams.scenario import Scenario
from experiments.calls import only_own_words, read_given, result_folder, shown_progress
from experiments.command_options import open_bus
from experiments.hardware.driven_run import (
    FirstCommand,
    check_scenario,
    drive_scenario,
    real_time_priority,
)
from experiments.hardware.statics import StaticCheck
from experiments.kept_run import Run
from pfsc_drake.drivers.link import ControllerEnd
from pfsc_drake.drivers.messages import dialect
from pfsc_drake.errors import InputError


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
    end = _link(lcm, driver)
    with result_folder(out) as folder, only_own_words():
        with shown_progress(loaded.name, duration, quiet) as progress:
            outcome = drive_scenario(
                loaded,
                end,
                out=folder.path,
                duration=duration,
                figures=figures,
                recording=recording,
                progress=progress,
                override=override,
                native=native,
            )
        assert outcome is not None
        return folder.run_of(outcome)


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
    told: list[FirstCommand] = []
    loaded = read_given(scenario, changes or {})
    end = _link(lcm, driver)
    with only_own_words(), shown_progress(loaded.name, None, quiet, paced=False) as progress:
        drive_scenario(
            loaded,
            end,
            out=Path(),
            duration=None,
            figures=False,
            recording=False,
            progress=progress,
            dry_run=told.append,
        )
    return told[0]


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
