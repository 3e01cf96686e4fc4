"""Commands beyond runs: studies, teaching, margins, export and replay."""

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
from pfsc_drake.errors import InputError, shorten, suggestion
from reporting.progress import ProgressDisplay
from reporting.terminal import FAULT, interruptible, show_page

_LONGEST_RECORD = 600.0  # s, of a run beside an exported controller
_STUDIES = {
    "robustness": (
        "experiments.studies.robustness.write_robustness",
        "robustness of all laws to model errors",
    ),
    "fastest": (
        "experiments.studies.fastest.write_fastest",
        "time-optimal motions on ten paths, compared with the optimum",
    ),
    "crossings": (
        "experiments.studies.crossings.write_crossings",
        "300 random persons crossing a path",
    ),
    "two_arms": (
        "experiments.studies.two_arms.write_two_arms",
        "knowledge of the workpiece's motion, over the speed of two arms",
    ),
    IDENTIFICATION: (
        "experiments.studies.identify.write_identification",
        "identification of robot models, and control with them",
    ),
    TEACH_IN: (
        "experiments.teaching.teach.write_teach_in",
        "teaching a path by hand guiding, and following it",
    ),
}


def _complete_study(incomplete: str) -> list[tuple[str, str]]:
    """Return the studies that complete a name, with their descriptions."""
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
    """Run a study: many runs on one page, on all cores, in minutes."""
    if name not in _STUDIES:
        allowed = ", ".join(_STUDIES)
        raise InputError(f"study {shorten(name)}: allowed: {allowed}{suggestion(name, _STUDIES)}")
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
    """Options of a taught path."""

    spacing: Annotated[float, typer.Option(help="Spacing of the waypoints [m].")] = 0.01
    angle: Annotated[
        float, typer.Option(help="Rotation after which a further waypoint is taken [deg].")
    ] = 3.0
    tolerance: Annotated[
        float, typer.Option(help="Largest distance of the path from a waypoint [m].")
    ] = 2e-3
    tolerance_deg: Annotated[
        float, typer.Option(help="Largest angle of the path from a waypoint's orientation [deg].")
    ] = 1.0
    closed: Annotated[
        bool, typer.Option("--closed", help="Close the path, and follow it periodically.")
    ] = False
    velocity: Annotated[float, typer.Option(help="Speed along the path [m/s].")] = 0.1


def teach_command(
    run: Annotated[Path, typer.Argument(help="Folder of a hand-guiding run.")],
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("out/taught"),
    *,
    path: TaughtPath,
    follow: Annotated[
        bool, typer.Option("--follow/--no-follow", help="Simulate a run that follows the path.")
    ] = True,
) -> None:
    """Turn a hand-guiding run into a path, and follow it."""
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
        float, typer.Option(help="Relative error of masses and inertias to tolerate.")
    ] = 0.05,
    stiffness: Annotated[
        float, typer.Option(help="Relative error of joint stiffnesses to tolerate.")
    ] = 0.05,
    rotor: Annotated[
        float, typer.Option(help="Relative error of rotor inertias to tolerate.")
    ] = 0.0,
    tool: Annotated[float, typer.Option(help="Error of the tool's mass to tolerate [kg].")] = 0.1,
) -> None:
    """Compute stability margins of the sampled loop: modes, drives, delay, model errors."""
    from experiments.scenario_file import read_scenario
    from experiments.studies.margins.box import ErrorBox
    from experiments.studies.margins.margins_page import (
        case_table,
        point_table,
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
        for table in (point_table(analysis), case_table(analysis)):
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
        typer.Option("--check", help="Compile it, replay the recorded run and compare; needs gcc."),
    ] = False,
    duration: Annotated[
        str, typer.Option(metavar="SECONDS", help="Simulated time of the recorded run in s.")
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
    folder: Annotated[Path, typer.Argument(help="Folder of an exported controller.")],
    log: Annotated[
        Path,
        typer.Argument(
            help="log.h5 of a run, or a CSV file of a robot: t, q_1, .., v_1, .., optionally "
            "q_M_1, .., v_M_1, .., and name_1, .. of every further input."
        ),
    ],
) -> None:
    """Compute the commands of an exported controller for a log; needs gcc."""
    from experiments.controller_replay import replay_log

    with interruptible():
        console, exported = Console(), expand_home(folder)
        with ProgressDisplay(console, exported.name, None, paced=False) as progress:
            commands = replay_log(exported, expand_home(log), progress)
        raise typer.Exit(judge_commands(console, commands))
