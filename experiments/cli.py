"""The command line: ``list`` scenarios, ``run`` one, ``compare`` runs, ``study`` the laws.

Exit status: 0 the run completed; 2 the input is wrong (one line on stderr); 3 a fault stopped the
run, everything logged so far is kept; 130 interrupted.
"""

import dataclasses
import json
import logging
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from experiments.catalog.scenario_catalog import list_scenarios
from experiments.progress import ProgressDisplay
from pfsc_drake.errors import InputError

if TYPE_CHECKING:
    from experiments.catalog.scenario_file import ScenarioFile
    from experiments.results.metrics import Metrics

WRONG_INPUT = 2
FAULT = 3
INTERRUPTED = 130

app = typer.Typer(
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Path and surface following experiments, from scenario files to reports.",
)


@app.command("list")
def list_command(
    as_json: Annotated[bool, typer.Option("--json", help="Print a JSON list instead.")] = False,
) -> None:
    """List the shipped scenarios."""
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
    scenario: Annotated[
        str, typer.Argument(help="Name of a shipped scenario, or path of a YAML file.")
    ],
    out: Annotated[
        Path | None, typer.Option(help="Folder for the results. [default: out/SCENARIO]")
    ] = None,
    overrides: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY.PATH=VALUE", help="Override a key; repeatable."),
    ] = None,
    duration: Annotated[
        float | None, typer.Option(help="Simulated time in s, instead of the scenario's.")
    ] = None,
    figures: Annotated[bool, typer.Option("--figures/--no-figures", help="Draw figures.")] = True,
    recording: Annotated[
        bool, typer.Option("--recording/--no-recording", help="Record the motion.")
    ] = True,
) -> None:
    """Run a scenario and write log, metrics, figures, recording and report."""
    from experiments.catalog.scenario_file import read_scenario

    if duration is not None and not (math.isfinite(duration) and duration > 0.0):
        raise InputError(f"--duration {duration:g}: allowed: a positive number of seconds")
    loaded = read_scenario(scenario, overrides or [])
    out = out if out is not None else Path("out") / loaded.name
    if out.exists() and not out.is_dir():
        raise InputError(f"--out {out}: is a file; allowed: a folder")
    try:
        status = _run(loaded, out, duration, figures, recording)
    except KeyboardInterrupt:
        _print_error("interrupted")
        status = INTERRUPTED
    raise typer.Exit(status)


@app.command("compare")
def compare_command(
    runs: Annotated[list[Path], typer.Argument(help="Folders of two or more runs.")],
    out: Annotated[Path, typer.Option(help="Folder for the page.")] = Path("out/comparison"),
) -> None:
    """Put several runs on one page."""
    from experiments.pages.compare import write_comparison

    page = write_comparison(runs, out)
    Console().print(f"Open the comparison: [bold cyan]{escape(str(page))}[/]", soft_wrap=True)


@app.command("study")
def study_command(
    out: Annotated[Path, typer.Option(help="Folder for the page.")] = Path("out/study"),
) -> None:
    """Which law when: all laws on joints of rising stiffness (about a minute)."""
    from experiments.studies.stiffness import write_study

    logging.getLogger("drake").setLevel(logging.WARNING)
    console = Console()
    page = write_study(out, lambda line: console.print(line, highlight=False, markup=False))
    console.print(f"Open the study: [bold cyan]{escape(str(page))}[/]", soft_wrap=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line.

    Args:
        arguments: Without the program's name; by default those of the process.

    Returns:
        Exit status, see the module.
    """
    usage_error: Any = typer.BadParameter.__base__
    try:
        status = app(
            args=None if arguments is None else list(arguments),
            prog_name="python -m experiments",
            standalone_mode=False,
        )
    except InputError as error:
        return _fail(str(error))
    except usage_error as error:
        reason = _one_line(error.format_message()).rstrip(".")
        return _fail(f"{reason}; see python -m experiments --help")
    return status if isinstance(status, int) else 0


def _run(
    scenario: "ScenarioFile",
    out: Path,
    duration: float | None,
    figures: bool,
    recording: bool,
) -> int:
    """Runs a scenario with progress and prints what came out; returns the exit status."""
    from experiments.run import run_scenario

    logging.getLogger("drake").setLevel(logging.WARNING)
    console = Console()
    with ProgressDisplay(console, scenario.name, duration) as progress:
        outcome = run_scenario(
            scenario,
            out=out,
            duration=duration,
            figures=figures,
            recording=recording,
            progress=progress,
        )
    console.print(_metrics_table(outcome.metrics))
    for warning in outcome.warnings:
        console.print(f"\n[yellow]warning:[/] {escape(warning)}", soft_wrap=True)
    # Soft wrap: a path broken into two lines cannot be clicked.
    console.print(f"\nOpen the report: [bold cyan]{escape(str(outcome.report))}[/]", soft_wrap=True)
    if outcome.fault is None:
        return 0
    _print_error(
        f"fault: {_one_line(outcome.fault)}; stopped at t = {progress.simulated_time:.3f} s,"
        f" everything logged so far is kept in {out}"
    )
    return FAULT


def _metrics_table(metrics: "Metrics") -> Table:
    """The metrics with their targets, one line each."""
    from experiments.results.units import format_quantity

    table = Table(box=None, header_style="bold", padding=(0, 2, 0, 0))
    table.add_column("Metric", no_wrap=True)
    table.add_column("Value", justify="right", no_wrap=True)
    table.add_column("Target")
    marks = {True: "[green]met[/]", False: "[red]missed[/]", None: ""}
    for name, metric in metrics.items():
        target = escape(metric.target or "")
        if metric.bound is not None:
            comparison, number = metric.bound
            target = f"{comparison} {format_quantity(number, metric.unit)}"
        value = format_quantity(metric.value, metric.unit)
        table.add_row(name, value, f"{target} {marks[metric.passed]}".strip())
    return table


def _fail(message: str) -> int:
    """Reports wrong input."""
    _print_error(f"error: {_one_line(message)}")
    return WRONG_INPUT


def _print_error(line: str) -> None:
    """One line on stderr, whatever the terminal's width."""
    typer.echo(line, err=True)


def _one_line(message: str) -> str:
    """A message without line breaks."""
    return " ".join(message.split())
