"""Commands that ask more of a scenario than a run: studies, margins, C, inverse kinematics."""

import importlib
import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from experiments.command_options import (
    IDENTIFICATION,
    TEACH_IN,
    Overrides,
    Quiet,
    ScenarioName,
    read_duration,
)
from experiments.outcomes import (
    judge_commands,
    judge_replay,
    print_export,
)
from experiments.scenario_file import expand_home
from pfsc_drake.errors import InputError, shortened, suggestion
from reporting.progress import ProgressDisplay
from reporting.terminal import FAULT, interruptible, show_page

_LONGEST_RECORD = 600.0  # s, of a run beside an exported controller
_STUDIES = {
    "robustness": (
        "experiments.studies.robustness.write_robustness",
        "all laws on robots that are not their models",
    ),
    "fastest": (
        "experiments.studies.fastest.write_fastest",
        "the fastest motion on ten paths, and how near it is to the best",
    ),
    "crossings": (
        "experiments.studies.crossings.write_crossings",
        "300 persons who walk across a path at random",
    ),
    "two_arms": (
        "experiments.studies.two_arms.write_two_arms",
        "what must be known of a workpiece's motion, over the speed of two arms",
    ),
    IDENTIFICATION: (
        "experiments.studies.identify.write_identification",
        "from robots to their models and back",
    ),
    TEACH_IN: (
        "experiments.teaching.teach.write_teach_in",
        "a path taught by hand, and followed",
    ),
}


def _complete_study(incomplete: str) -> list[tuple[str, str]]:
    """Return the studies whose names go on like this, with what they are."""
    return [(name, text) for name, (_, text) in _STUDIES.items() if name.startswith(incomplete)]


def study_command(
    name: Annotated[
        str,
        typer.Argument(
            help="; ".join(f"{name}: {text}" for name, (_, text) in _STUDIES.items()) + ".",
            autocompletion=_complete_study,
        ),
    ],
    out: Annotated[Path, typer.Option(help="Folder for the page.")] = Path("out/study"),
    quiet: Quiet = False,
) -> None:
    """Many runs on one page, on all cores, in minutes; further studies are pages of the site."""
    if name not in _STUDIES:
        allowed = ", ".join(_STUDIES)
        raise InputError(f"study {shortened(name)}: allowed: {allowed}{suggestion(name, _STUDIES)}")
    module, _, function = _STUDIES[name][0].rpartition(".")
    write = getattr(importlib.import_module(module), function)
    with interruptible():
        logging.getLogger("drake").setLevel(logging.CRITICAL)
        console = Console(quiet=quiet)
        report = write(
            expand_home(out), lambda line: console.print(line, highlight=False, markup=False)
        )
        raise typer.Exit(show_page("study", report))


@dataclass
class TaughtPath:
    """How a path is made of a motion, and followed."""

    spacing: Annotated[float, typer.Option(help="Of the waypoints [m].")] = 0.01
    angle: Annotated[
        float, typer.Option(help="Turn after which a waypoint is taken before that [deg].")
    ] = 3.0
    tolerance: Annotated[
        float, typer.Option(help="How far the path may be from a waypoint [m].")
    ] = 2e-3
    tolerance_deg: Annotated[float, typer.Option(help="The same of the orientation [deg].")] = 1.0
    closed: Annotated[bool, typer.Option("--closed", help="Go round and round.")] = False
    velocity: Annotated[float, typer.Option(help="Along the path [m/s].")] = 0.1


def teach_command(
    run: Annotated[Path, typer.Argument(help="Folder of a run in which a hand led the tool.")],
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("out/taught"),
    *,
    path: TaughtPath,
    follow: Annotated[
        bool, typer.Option("--follow/--no-follow", help="Run along the path.")
    ] = True,
) -> None:
    """Turn a run in which a hand led the tool into a path, and follow it."""
    from experiments.teaching.taught_path import TeachingOptions
    from experiments.teaching.teach import teach

    with interruptible():
        options = TeachingOptions(
            path.spacing,
            path.angle,
            path.closed,
            path.tolerance,
            path.tolerance_deg,
            path.velocity,
        )
        logging.getLogger("drake").setLevel(logging.CRITICAL)
        console = Console()
        outcome = teach(
            expand_home(run),
            expand_home(out),
            options,
            follow=follow,
            progress=lambda line: console.print(line, highlight=False, markup=False),
        )
        status = show_page("page", outcome.report)
        raise typer.Exit(FAULT if outcome.fault is not None and status == 0 else status)


def margins_command(
    scenario: ScenarioName,
    overrides: Overrides = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the page. Default: out/SCENARIO_margins")
    ] = None,
    mass: Annotated[
        float, typer.Option(help="Relative error of masses and inertias to be borne.")
    ] = 0.05,
    stiffness: Annotated[
        float, typer.Option(help="Relative error of joint stiffnesses to be borne.")
    ] = 0.05,
    rotor: Annotated[
        float, typer.Option(help="Relative error of rotor inertias to be borne.")
    ] = 0.0,
    tool: Annotated[float, typer.Option(help="Error of the tool's mass to be borne [kg].")] = 0.1,
) -> None:
    """Tell before a robot moves what its sampled loop bears: modes, drives, delay, model errors."""
    from experiments.scenario_file import read_scenario
    from experiments.studies.margins.box import ErrorBox
    from experiments.studies.margins.margins_page import (
        case_table,
        place_table,
        summary,
        write_margins,
    )

    with interruptible():
        loaded = read_scenario(scenario, overrides or [])
        folder = expand_home(out) if out is not None else Path("out") / f"{loaded.name}_margins"
        logging.getLogger("drake").setLevel(logging.CRITICAL)
        console, box = Console(), ErrorBox(mass, stiffness, rotor, tool)
        with ProgressDisplay(console, loaded.name, None, paced=False) as progress:
            analysis, report = write_margins(loaded, folder, box, progress)
        for table in (place_table(analysis), case_table(analysis)):
            console.print(table)
            console.print()
        console.print(summary(analysis), highlight=False)
        raise typer.Exit(show_page("margins", report))


def export_command(
    scenario: ScenarioName,
    out: Annotated[Path, typer.Option(help="Folder for the files.")],
    overrides: Overrides = None,
    check: Annotated[
        bool,
        typer.Option(
            "--check", help="Compile it, let it repeat the run and compare; needs gcc for that."
        ),
    ] = False,
    duration: Annotated[
        str, typer.Option(metavar="SECONDS", help="Simulated time of the run beside it in s.")
    ] = "1",
) -> None:
    """Write a scenario's controller as C99."""
    from experiments.controller_replay import check_export, missing_tool
    from experiments.export import export_scenario
    from experiments.scenario_file import read_scenario

    seconds = read_duration(duration, _LONGEST_RECORD)
    with interruptible():
        loaded = read_scenario(scenario, overrides or [])
        folder = expand_home(out)
        logging.getLogger("drake").setLevel(logging.CRITICAL)
        console, lacking = Console(), missing_tool()
        with ProgressDisplay(console, loaded.name, None, paced=False) as progress:
            controller, files = export_scenario(loaded, folder, seconds, progress)
            replay = check_export(folder, progress) if check and lacking is None else None
        print_export(console, controller, files, folder)
        if check and replay is None:
            console.print(f"not compiled: there is no {lacking} here", highlight=False)
        raise typer.Exit(0 if replay is None else judge_replay(console, replay, folder))


def replay_command(
    folder: Annotated[Path, typer.Argument(help="Of an exported controller.")],
    log: Annotated[
        Path,
        typer.Argument(
            help="log.h5 of a run, or a CSV of a robot: t, q_1, .., v_1, .., perhaps q_M_1, .., "
            "v_M_1, .., and name_1, .. of every further input."
        ),
    ],
) -> None:
    """Tell what an exported controller would have commanded, before power is on; needs gcc."""
    from experiments.controller_replay import replay_log

    with interruptible():
        console, place = Console(), expand_home(folder)
        with ProgressDisplay(console, place.name, None, paced=False) as progress:
            commands = replay_log(place, expand_home(log), progress)
        raise typer.Exit(judge_commands(console, commands))
