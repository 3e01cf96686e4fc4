"""The command line: ``list``, ``run``, ``live``, ``compare``, ``sweep``, ``teach`` and others.

Exit status: 0 the run completed, or every run of a sweep has a row that says how it ended; 2 the
input is wrong, nothing was run (one line on stderr); 3 a fault stopped the run, or a live session
ended while one did, everything logged so far is kept; 4 results could not be written, one line
says which and where they are instead; 130 interrupted, everything logged so far is kept.
"""

import dataclasses
import json
import logging
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from experiments.outcomes import (
    judge_commands,
    judge_live,
    judge_replay,
    judge_run,
    judge_sweep,
    print_export,
    print_live,
    print_run,
    print_sweep,
)
from experiments.scenario_file import expand_home, list_scenarios
from pfsc_drake.errors import InputError, shortened
from pfsc_drake.yaml.schema_check import is_number
from reporting.progress import ProgressDisplay
from reporting.registry import as_data, as_text
from reporting.terminal import FAULT, interruptible, run_app, show_page

if TYPE_CHECKING:
    from reporting.page import Report

_LONGEST_AFTER_FAULT = 100.0  # s
_WIDEST_TABLE = 160  # columns, of postures
# studies that run by their names, as a scenario does
IDENTIFICATION, TEACH_IN = "identify_comau", "teach_in"

# what several commands take
ScenarioName = Annotated[
    str, typer.Argument(help="Name of a shipped scenario, or path of a YAML file.")
]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY.PATH=VALUE", help="Override a key; repeatable."),
]
Duration = Annotated[
    str | None,
    typer.Option(metavar="SECONDS", help="Simulated time in s, instead of the scenario's."),
]

app = typer.Typer(
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Path and surface following experiments, from scenario files to reports.",
)


@app.command("list")
def list_command(
    as_json: Annotated[bool, typer.Option("--json", help="Print a JSON list instead.")] = False,
    signals: Annotated[
        bool, typer.Option("--signals", help="Signals, metrics and figures of runs instead.")
    ] = False,
) -> None:
    """List the shipped scenarios."""
    if signals:
        typer.echo(json.dumps(as_data(), indent=2) if as_json else as_text(), nl=as_json)
        return
    entries = list_scenarios()
    if as_json:
        typer.echo(json.dumps([dataclasses.asdict(entry) for entry in entries], indent=2))
        return
    table = Table(box=None, header_style="bold", padding=(0, 2, 0, 0))
    table.add_column("Scenario", style="cyan", no_wrap=True)
    table.add_column("Section", no_wrap=True)
    table.add_column("Description")
    for entry in entries:
        table.add_row(entry.name, escape(entry.section), escape(entry.description))
    Console().print(table)


@app.command("run")
def run_command(
    scenario: ScenarioName,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for the results: a new one or that of an earlier run, whose results are "
            "replaced; a user's own files never are. Default: out/SCENARIO"
        ),
    ] = None,
    overrides: Overrides = None,
    duration: Duration = None,
    figures: Annotated[bool, typer.Option("--figures/--no-figures", help="Draw figures.")] = True,
    recording: Annotated[
        bool, typer.Option("--recording/--no-recording", help="Record the motion.")
    ] = True,
    after_fault: Annotated[
        str,
        typer.Option(
            metavar="SECONDS", help="Go on for that long after a fault, to see how it ends."
        ),
    ] = "0",
    margins: Annotated[
        bool, typer.Option("--margins", help="Tell what the loop bears at the start.")
    ] = False,
) -> None:
    """Run a scenario and write log, metrics, figures, recording and report."""
    from experiments.run import run_scenario
    from experiments.scenario_file import read_scenario

    if scenario in (IDENTIFICATION, TEACH_IN):
        study_command(scenario, out or Path("out") / scenario)
    seconds = None if duration is None else _read_duration(duration)
    further = _read_after_fault(after_fault)
    with interruptible():
        loaded = read_scenario(scenario, overrides or [])
        folder = expand_home(out) if out is not None else Path("out") / loaded.name
        logging.getLogger("drake").setLevel(logging.CRITICAL)
        console = Console()
        with ProgressDisplay(console, loaded.name, seconds) as progress:
            outcome = run_scenario(
                loaded,
                out=folder,
                duration=seconds,
                figures=figures,
                recording=recording,
                progress=progress,
                after_fault=further,
                margins=margins,
            )
        print_run(console, outcome)
        raise typer.Exit(judge_run(outcome, folder, progress.simulated_time))


@app.command("live")
def live_command(
    scenario: ScenarioName,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder in which every take gets one of its own, take_1, take_2, ... "
            "Default: out/SCENARIO_live"
        ),
    ] = None,
    overrides: Overrides = None,
    port: Annotated[
        int, typer.Option(help="Of the page, on this machine alone; 0 for any that is free.")
    ] = 0,
    duration: Annotated[
        str | None,
        typer.Option(
            metavar="SECONDS", help="Simulated time in s after which it ends. Default: 600"
        ),
    ] = None,
    figures: Annotated[bool, typer.Option("--figures/--no-figures", help="Draw figures.")] = True,
    recording: Annotated[
        bool, typer.Option("--recording/--no-recording", help="Record the motion.")
    ] = True,
) -> None:
    """Guide the robot of a scenario yourself, in real time, on a page in your browser."""
    from experiments.live.start import run_live
    from experiments.scenario_file import read_scenario

    seconds = None if duration is None else _read_duration(duration)
    with interruptible():
        loaded = read_scenario(scenario, overrides or [])
        folder = expand_home(out) if out is not None else Path("out") / f"{loaded.name}_live"
        logging.getLogger("drake").setLevel(logging.CRITICAL)
        console = Console()

        def tell(line: str) -> None:
            text = f"{loaded.name}: {line}"
            console.print(text, highlight=False, markup=False, soft_wrap=True)

        outcome = run_live(
            loaded,
            out=folder,
            port=port,
            duration=seconds,
            figures=figures,
            recording=recording,
            tell=tell,
        )
        print_live(console, outcome)
        raise typer.Exit(judge_live(outcome))


@app.command("compare")
def compare_command(
    runs: Annotated[list[Path], typer.Argument(help="Folders of two or more runs.")],
    out: Annotated[Path, typer.Option(help="Folder for the page.")] = Path("out/comparison"),
) -> None:
    """Put several runs on one page."""
    from experiments.compare import write_comparison

    with interruptible():
        report = write_comparison([expand_home(run) for run in runs], expand_home(out))
        raise typer.Exit(show_page("comparison", report))


@app.command("sweep")
def sweep_command(
    scenario: ScenarioName,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY.PATH=VALUES",
            help="What varies: a,b,c or linspace(low,high,n), in all combinations; or at random "
            "low:high, loguniform(low,high), normal(mean,sd), choice(a,b), each with *n for a "
            "list of n. Repeatable.",
        ),
    ] = None,
    samples: Annotated[int | None, typer.Option(help="Number of random draws.")] = None,
    seed: Annotated[int, typer.Option(help="Of the random draws.")] = 0,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Dask scheduler, e.g. tcp://10.0.0.1:8786, whose workers run in a clone of this "
            "revision. Default: all cores of this machine",
        ),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Processes on this machine. Default: one per core")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for the results; the same command goes on with what is missing there. "
            "Default: out/SCENARIO_sweep"
        ),
    ] = None,
    overrides: Overrides = None,
    duration: Duration = None,
    metric: Annotated[
        str | None, typer.Option(help="What to draw. Default: max_path_deviation")
    ] = None,
) -> None:
    """Run a scenario many times, on all cores: grids, ranges, distributions over its keys."""
    from experiments.sweep.sweep import define_sweep, run_sweep

    seconds = None if duration is None else _read_duration(duration)
    with interruptible():
        sweep = define_sweep(
            scenario,
            vary or [],
            overrides=overrides or [],
            duration=seconds,
            samples=samples,
            seed=seed,
        )
        name = sweep.scenario.name
        folder = expand_home(out) if out is not None else Path("out") / f"{name}_sweep"
        console = Console()
        outcome = run_sweep(
            sweep, folder, console, scheduler=scheduler, workers=workers, metric=metric
        )
        print_sweep(console, outcome)
        raise typer.Exit(judge_sweep(outcome, folder))


@app.command("study")
def study_command(
    name: Annotated[
        str,
        typer.Argument(
            help="stiffness: which law when, all laws on joints of rising stiffness; robustness: "
            "all laws on robots that are not their models; tracking: path following against "
            "trajectory tracking; fixture_rules: printed rules of forbidden regions against the "
            "program at an acute edge; identify_comau: from robots to their models and back; "
            "teach_in: a path taught by hand, and followed."
        ),
    ] = "stiffness",
    out: Annotated[Path, typer.Option(help="Folder for the page.")] = Path("out/study"),
) -> None:
    """Many runs on one page, on all cores: one minute (stiffness) to ten."""
    from experiments.studies.fixture_rules import write_fixture_rules
    from experiments.studies.identify import write_identification
    from experiments.studies.robustness import write_robustness
    from experiments.studies.stiffness import write_study
    from experiments.studies.tracking import write_tracking
    from experiments.teaching.teach import write_teach_in

    studies: dict[str, Callable[[Path, Callable[[str], None]], Report]] = {
        "stiffness": write_study,
        "robustness": write_robustness,
        "tracking": write_tracking,
        "fixture_rules": write_fixture_rules,
        IDENTIFICATION: write_identification,
        TEACH_IN: write_teach_in,
    }
    if name not in studies:
        raise InputError(f"study {shortened(name)}: allowed: {', '.join(studies)}")
    with interruptible():
        logging.getLogger("drake").setLevel(logging.CRITICAL)
        console = Console()
        report = studies[name](
            expand_home(out), lambda line: console.print(line, highlight=False, markup=False)
        )
        raise typer.Exit(show_page("study", report))


@app.command("teach")
def teach_command(
    run: Annotated[Path, typer.Argument(help="Folder of a run in which a hand led the tool.")],
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("out/taught"),
    spacing: Annotated[float, typer.Option(help="Of the waypoints [m].")] = 0.01,
    angle: Annotated[
        float, typer.Option(help="Turn after which a waypoint is taken before that [deg].")
    ] = 3.0,
    tolerance: Annotated[
        float, typer.Option(help="How far the path may be from a waypoint [m].")
    ] = 2e-3,
    tolerance_deg: Annotated[float, typer.Option(help="The same of the orientation [deg].")] = 1.0,
    closed: Annotated[bool, typer.Option("--closed", help="Go round and round.")] = False,
    velocity: Annotated[float, typer.Option(help="Along the path [m/s].")] = 0.1,
    follow: Annotated[
        bool, typer.Option("--follow/--no-follow", help="Run along the path.")
    ] = True,
) -> None:
    """Turn a run in which a hand led the tool into a path, and follow it."""
    from experiments.teaching.taught import TeachingOptions
    from experiments.teaching.teach import teach

    with interruptible():
        options = TeachingOptions(spacing, angle, closed, tolerance, tolerance_deg, velocity)
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


@app.command("margins")
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
    from experiments.studies.margins.box import Box
    from experiments.studies.margins.page import case_table, place_table, summary, write_margins

    with interruptible():
        loaded = read_scenario(scenario, overrides or [])
        folder = expand_home(out) if out is not None else Path("out") / f"{loaded.name}_margins"
        logging.getLogger("drake").setLevel(logging.CRITICAL)
        console, box = Console(), Box(mass, stiffness, rotor, tool)
        with ProgressDisplay(console, loaded.name, None, paced=False) as progress:
            outcome = write_margins(loaded, folder, box, progress)
        for table in (place_table(outcome.analysis), case_table(outcome.analysis)):
            console.print(table)
            console.print()
        console.print(summary(outcome.analysis), highlight=False)
        raise typer.Exit(show_page("margins", outcome.report))


@app.command("export")
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
    from experiments.export import export_scenario
    from experiments.replay import check_export, missing_tool
    from experiments.scenario_file import read_scenario

    seconds = _read_duration(duration)
    with interruptible():
        loaded = read_scenario(scenario, overrides or [])
        folder = expand_home(out)
        logging.getLogger("drake").setLevel(logging.CRITICAL)
        console, lacking = Console(), missing_tool()
        with ProgressDisplay(console, loaded.name, None, paced=False) as progress:
            export = export_scenario(loaded, folder, seconds, progress)
            replay = check_export(folder, progress) if check and lacking is None else None
        print_export(console, export, folder)
        if check and replay is None:
            console.print(f"not compiled: there is no {lacking} here", highlight=False)
        raise typer.Exit(0 if replay is None else judge_replay(console, replay, folder))


@app.command("replay")
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
    from experiments.replay import replay_log

    with interruptible():
        console, place = Console(), expand_home(folder)
        with ProgressDisplay(console, place.name, None, paced=False) as progress:
            commands = replay_log(place, expand_home(log), progress)
        raise typer.Exit(judge_commands(console, commands))


@app.command("inverse-kinematics")
def inverse_kinematics_command(
    model: Annotated[
        str, typer.Argument(help="Name of a shipped arm, or path of a parameters.yaml.")
    ],
    position: Annotated[
        tuple[float, float, float],
        typer.Option(metavar="X Y Z", help="Tool point in the base frame [m]."),
    ],
    zyx_deg: Annotated[
        tuple[float, float, float],
        typer.Option(
            metavar="A B C",
            help="Angles of the flange about z, then the new y, then the new x [deg].",
        ),
    ],
) -> None:
    """Print all postures of an arm with a spherical wrist that reach a pose, in closed form."""
    from experiments.inverse_kinematics import find_postures, posture_table

    with interruptible():
        postures = find_postures(model, np.array(position), np.array(zyx_deg))
        table, console = posture_table(postures), Console()
        # angles that a narrow terminal cuts off are worth nothing
        console.width = max(console.width, _WIDEST_TABLE)
        console.print(table)
        within = sum(posture.branch.is_within_limits for posture in postures)
        console.print(f"{within} of {len(postures)} within the limits, angles in deg")
        if any(p.branch.is_singular for p in postures):
            console.print(
                "theta_1 of an open shoulder and theta_4 of a straight wrist are free: 0 stands "
                "for all"
            )


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line.

    Args:
        arguments: Without the program's name; by default those of the process.

    Returns:
        Exit status, see the module.
    """
    return run_app(app, "python -m experiments", arguments)


def _read_duration(text: str) -> float:
    """The value of ``--duration`` in s."""
    seconds = float(text) if is_number(text) else math.nan
    if not (math.isfinite(seconds) and seconds > 0.0):
        raise InputError(f"--duration {shortened(text)}: allowed: a positive number of seconds")
    return seconds


def _read_after_fault(text: str) -> float:
    """The value of ``--after-fault`` in s."""
    seconds = float(text) if is_number(text) else math.nan
    if not 0.0 <= seconds <= _LONGEST_AFTER_FAULT:
        raise InputError(
            f"--after-fault {shortened(text)}: allowed: 0 to {_LONGEST_AFTER_FAULT:g} seconds"
        )
    return seconds
