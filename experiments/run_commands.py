"""Commands that run scenarios: ``list``, ``schema``, ``run``, ``live``, ``compare``, ``sweep``."""

import dataclasses
import json
import logging
import math
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from experiments.command_options import (
    IDENTIFICATION,
    TEACH_IN,
    Bus,
    ChosenScenario,
    Drawn,
    Quiet,
    TimedScenario,
    folder_or,
    open_bus,
    read_duration,
)
from experiments.outcomes import (
    judge_live,
    judge_run,
    judge_sweep,
    print_line,
    print_live,
    print_run,
    print_sweep,
    print_warning,
)
from experiments.scenario_file import expand_home, list_scenarios
from experiments.study_commands import study_command
from pfsc_drake.checks import is_number
from pfsc_drake.errors import InputError, shorten
from reporting.progress import ProgressDisplay
from reporting.registry import as_data, as_text
from reporting.terminal import interruptible, show_page

_LONGEST_AFTER_FAULT = 100.0  # s


def list_command(
    as_json: Annotated[bool, typer.Option("--json", help="Print as JSON.")] = False,
    signals: Annotated[
        bool, typer.Option("--signals", help="List signals, metrics and figures of runs instead.")
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


def schema_command(
    tags: Annotated[
        bool, typer.Option("--tags", help="Print VS Code settings for the YAML tags instead.")
    ] = False,
) -> None:
    """Print the JSON schema of scenario files, for completion and checks in an editor."""
    from diagrams.scenario import Scenario
    from pfsc_drake.yaml.json_schema import json_schema, tags_of

    mappings = {"yaml.customTags": [f"{tag} mapping" for tag in tags_of(Scenario)]}
    schema = mappings if tags else json_schema(Scenario, "Scenario of pfsc_drake")
    typer.echo(json.dumps(schema, indent=1, ensure_ascii=False))


def run_command(
    *,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for the results. Results of an earlier run are replaced, a user's own "
            "files never. Default: out/SCENARIO"
        ),
    ] = None,
    chosen: TimedScenario,
    drawn: Drawn,
    after_fault: Annotated[
        str,
        typer.Option(
            metavar="SECONDS", help="Continue the simulation for this time after a fault."
        ),
    ] = "0",
    margins: Annotated[
        bool, typer.Option("--margins", help="Compute stability margins of the loop at the start.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Run a scenario and write log, metrics, figures, recording and report."""
    from experiments.simulated_run import RunOptions, run_scenario

    if chosen.scenario in (IDENTIFICATION, TEACH_IN):
        study_command(chosen.scenario, out or Path("out") / chosen.scenario, quiet)
    seconds, further = chosen.seconds, _read_after_fault(after_fault)
    with interruptible():
        loaded = chosen.read((IDENTIFICATION, TEACH_IN))
        folder = folder_or(out, loaded.name)
        logging.getLogger("drake").setLevel(logging.CRITICAL)
        console = Console(quiet=quiet)
        printed: list[str] = []

        def warn(sentence: str) -> None:
            printed.append(sentence)
            print_warning(console, sentence)

        with ProgressDisplay(console, loaded.name, seconds) as progress:
            outcome = run_scenario(
                loaded,
                out=folder,
                options=RunOptions(seconds, further, margins, drawn.figures, drawn.recording),
                progress=progress,
                warn=warn,
            )
        print_run(console, outcome, printed)
        raise typer.Exit(judge_run(outcome, folder, progress.simulated_time))


def live_command(
    *,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for the takes, in subfolders take_1, take_2, ... "
            "Default: out/SCENARIO_live"
        ),
    ] = None,
    chosen: ChosenScenario,
    port: Annotated[
        int, typer.Option(help="Port of the page on localhost; 0 for any free port.")
    ] = 0,
    watch: Annotated[
        bool,
        typer.Option("--watch", help="Monitor a robot controlled by `drive`: pause, speed, stop."),
    ] = False,
    bus: Bus,
    duration: Annotated[
        str | None,
        typer.Option(metavar="SECONDS", help="Simulated time of the session in s. Default: 600"),
    ] = None,
    drawn: Drawn,
) -> None:
    """Guide the robot of a scenario by hand in real time, on a page in the browser."""
    from experiments.live.start import run_live

    seconds = None if duration is None else read_duration(duration)
    with interruptible():
        loaded = chosen.read()
        logging.getLogger("drake").setLevel(logging.CRITICAL)
        console = Console()

        def notify(line: str) -> None:
            print_line(console, f"{loaded.name}: {line}")

        if watch:
            from experiments.live.watch import run_watch
            from pfsc_drake.drivers.link import ObserverEndpoint
            from pfsc_drake.drivers.messages import dialect

            run_watch(
                loaded, ObserverEndpoint(open_bus(bus.lcm), dialect(bus.driver)), port, notify
            )
            return
        session = run_live(
            loaded,
            port,
            seconds,
            notify,
            out=folder_or(out, f"{loaded.name}_live"),
            figures=drawn.figures,
            recording=drawn.recording,
        )
        print_live(console, session)
        raise typer.Exit(judge_live(session))


def compare_command(
    runs: Annotated[list[Path], typer.Argument(help="Folders of two or more runs.")],
    out: Annotated[Path, typer.Option(help="Folder for the page.")] = Path("out/comparison"),
) -> None:
    """Compare several runs on one page."""
    from experiments.compare import write_comparison

    with interruptible():
        report = write_comparison([expand_home(run) for run in runs], expand_home(out))
        raise typer.Exit(show_page("comparison", report))


@dataclasses.dataclass
class Variations:
    """Varied parameters of a sweep."""

    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY.PATH=VALUES",
            help="Values of a key: a,b,c or linspace(low,high,n), in all combinations; or random "
            "low:high, loguniform(low,high), normal(mean,sd), choice(a,b), each with *n for a "
            "list of n. Repeatable.",
        ),
    ] = None
    samples: Annotated[int | None, typer.Option(help="Number of random draws.")] = None
    seed: Annotated[int, typer.Option(min=0, help="Seed of the random draws.")] = 0


@dataclasses.dataclass
class Processes:
    """Processes of a sweep."""

    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Dask scheduler, e.g. tcp://10.0.0.1:8786, whose workers run in a clone of this "
            "revision. Default: all cores of this machine",
        ),
    ] = None
    workers: Annotated[
        int | None, typer.Option(min=1, help="Processes on this machine. Default: one per core")
    ] = None


def sweep_command(
    *,
    varied: Variations,
    processes: Processes,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for the results; a repeated command continues an incomplete sweep. "
            "Default: out/SCENARIO_sweep"
        ),
    ] = None,
    chosen: TimedScenario,
    metric: Annotated[
        str | None, typer.Option(help="Metric to draw. Default: max_path_deviation")
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Run a scenario many times on all cores, over grids or random values of its keys."""
    from experiments.sweep.sweep import define_sweep, run_sweep

    seconds = chosen.seconds
    with interruptible():
        sweep = define_sweep(
            chosen.scenario,
            varied.vary or [],
            overrides=chosen.overrides or [],
            duration=seconds,
            samples=varied.samples,
            seed=varied.seed,
        )
        folder = folder_or(out, f"{sweep.scenario.name}_sweep")
        console = Console(quiet=quiet)
        outcome = run_sweep(
            sweep,
            folder,
            console,
            scheduler=processes.scheduler,
            workers=processes.workers,
            metric=metric,
        )
        print_sweep(console, outcome)
        raise typer.Exit(judge_sweep(outcome, folder))


def _read_after_fault(text: str) -> float:
    """Return the value of ``--after-fault`` [s]."""
    seconds = float(text) if is_number(text) else math.nan
    if not 0.0 <= seconds <= _LONGEST_AFTER_FAULT:
        raise InputError(
            f"--after-fault {shorten(text)}: allowed: 0 to {_LONGEST_AFTER_FAULT:g} seconds"
        )
    return seconds
