"""Sweep: many runs of one scenario, with table, figures and report page."""

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from diagrams.scenario import Scenario
from experiments.scenario_file import ScenarioFile, read_scenario
from experiments.sweep.definition import (
    Sample,
    SweepDefinition,
    SweepRecord,
    draw_samples,
    parse_variations,
)
from experiments.sweep.many import count_cores, run_many
from experiments.sweep.summary import (
    choose_metric,
    count_ends,
    key_metrics,
    measure_spreads,
    striking_runs,
    summary_metrics,
    table_columns,
    to_csv,
    to_parquet,
    units_of,
)
from experiments.sweep.sweep_figures import draw_sweep
from experiments.sweep.worker import COMPLETED, REFUSED, RunRow, RunTask, program_revision
from pfsc_drake.errors import InputError, suggestion
from pfsc_drake.yaml.reading import dump_yaml
from pfsc_drake.yaml.source import Source
from pfsc_drake.yaml.typed import load_typed
from reporting.folder import ResultsFolder, check_folder, open_results
from reporting.interruption import watch_interruption
from reporting.metrics import Metric
from reporting.page import Page
from reporting.progress import CountDisplay
from reporting.provenance import standard_attributes

_KIND = "sweep"
# number of samples that are checked against the schema before the runs
_TRIED = 10
_MOST_STRIKING = 3


@dataclass(frozen=True)
class Sweep:
    """Sweep that is ready to start.

    Attributes:
        definition: Its definition.
        scenario: The scenario with common overrides.
        samples: Samples of all runs.
        tasks: The runs, in the same order.
    """

    definition: SweepDefinition
    scenario: ScenarioFile
    samples: list[Sample]
    tasks: list[RunTask]


@dataclass(frozen=True)
class SweepOutcome:
    """Outcome of a sweep.

    Attributes:
        report: The report page; None if it could not be written.
        rows: Rows by number of the sample.
        total: Number of all runs.
        commands: Command lines of runs to inspect, by their descriptions.
        metrics: The most important metrics of the whole sweep.
        warnings: Warnings, one sentence each.
        interrupted: Whether the user stopped it.
        stopped: Why runs are missing; or None.
        problem: Results that could not be written, with reason and substitute; or None.
    """

    report: Path | None
    rows: dict[int, RunRow]
    total: int
    commands: dict[str, str]
    metrics: dict[str, Metric]
    warnings: list[str]
    interrupted: bool
    stopped: str | None
    problem: str | None

    @property
    def refusal(self) -> str | None:
        """Reason of the first run's rejection, if all were rejected."""
        if not self.rows or any(row.status != REFUSED for row in self.rows.values()):
            return None
        return self.rows[min(self.rows)].reason


def define_sweep(
    scenario: str,
    vary: Sequence[str],
    *,
    overrides: Sequence[str] = (),
    duration: float | None = None,
    samples: int | None = None,
    seed: int = 0,
) -> Sweep:
    """Read and check a scenario and its variations before any run.

    Args:
        scenario: Name of a shipped scenario, or path of a YAML file.
        vary: ``key.path=values`` each, see :mod:`experiments.sweep.definition`.
        overrides: ``key.path=value`` each, the same for all runs.
        duration: Simulated time [s] instead of the scenario's.
        samples: Number of random draws.
        seed: Seed of the draws.

    Raises:
        InputError: If anything of it is wrong, or the scenario's schema takes none of the samples.
    """
    drawn = draw_samples(parse_variations(vary), samples, seed)
    loaded = read_scenario(scenario, list(overrides))
    definition = SweepDefinition(
        scenario,
        tuple(vary),
        tuple(overrides),
        duration,
        samples,
        seed,
        loaded.fingerprint,
    )
    tasks = [RunTask.of(_varied(loaded, sample), duration) for sample in drawn]
    _check_keys(loaded, tasks)
    return Sweep(definition, loaded, drawn, tasks)


def run_sweep(
    sweep: Sweep,
    out: Path,
    console: Console,
    *,
    scheduler: str | None = None,
    workers: int | None = None,
    metric: str | None = None,
) -> SweepOutcome:
    """Perform the missing runs of a sweep in a folder, and write the results.

    Args:
        sweep: From :func:`define_sweep`.
        out: Folder for the results; a part of the same sweep is continued.
        console: Console for progress.
        scheduler: Address of a Dask scheduler; None for processes of this machine.
        workers: Number of processes of this machine; None for all its cores.
        metric: Metric to draw; None for the default.

    Raises:
        InputError: If the folder cannot be used, ``workers`` go with ``scheduler``, no scheduler
            answers, or Dask is not installed; nothing has been run then.
    """
    if scheduler is not None and workers is not None:
        raise InputError(f"--workers {workers}: --scheduler brings its own; allowed: one of both")
    inputs = sweep.scenario.inputs()
    check_folder(out, _KIND, inputs)
    count_cores()  # without Dask the folder remains unchanged
    with (
        watch_interruption() as interrupted,
        open_results(out, _KIND, inputs, resume=True) as results,
    ):
        record = SweepRecord(results, sweep.definition)
        missing = record.missing(len(sweep.samples))
        title, done = sweep.scenario.name, len(sweep.samples) - len(missing)
        with CountDisplay(console, title, len(sweep.samples), done, COMPLETED) as progress:

            def take(number: int, row: RunRow) -> None:
                record.take(number, row)
                progress.advance(row.status)

            try:
                stopped = run_many(
                    {number: sweep.tasks[number] for number in missing},
                    take,
                    interrupted=interrupted,
                    scheduler=scheduler,
                    workers=workers,
                    idle=progress.processes,
                )
            finally:
                record.save()
        return _conclude(sweep, record.rows, results, metric, interrupted(), stopped)


def _conclude(
    sweep: Sweep,
    rows: dict[int, RunRow],
    results: ResultsFolder,
    requested: str | None,
    interrupted: bool,
    stopped: str | None,
) -> SweepOutcome:
    """Write table, metrics, figures and page."""
    columns = table_columns(sweep.samples, rows)
    results.write("scenario.yaml", dump_yaml(sweep.scenario.data))
    results.write("sweep.csv", to_csv(columns))
    results.write("sweep.parquet", to_parquet(columns, units_of(rows)))
    spreads = measure_spreads(rows)
    chosen = choose_metric(spreads, requested)
    metrics = summary_metrics(rows, chosen)
    results.write("metrics.json", metrics.to_json())
    commands = {
        strikes: sweep.definition.run_command(sweep.samples[number].overrides)
        for strikes, number in striking_runs(rows, chosen, _MOST_STRIKING).items()
    }
    figures = []
    if chosen is not None:
        varied = dict.fromkeys(name for sample in sweep.samples for name in sample.varied)
        figures = draw_sweep(spreads[chosen], columns, list(varied))
    warnings = _warnings(rows)
    if requested not in (None, chosen) and chosen is not None:
        available = f"{', '.join(spreads)}{suggestion(requested, spreads)}"
        warnings.append(f"--metric {requested}: no run has it; available: {available}")
    report = Page(
        kind="Sweep",
        title=sweep.scenario.name,
        description=_description(sweep, rows),
        scenario_yaml_text=dump_yaml(sweep.scenario.data),
        metrics=metrics,
        figures=figures,
        log_attributes=standard_attributes(sweep.scenario.name)
        | {"command": sweep.definition.command()},
        fault=stopped,
        interrupted=interrupted,
        warnings=warnings,
        commands=commands,
        cards=key_metrics(metrics, chosen),
    ).write(results)
    return SweepOutcome(
        report.path,
        rows,
        len(sweep.samples),
        commands,
        {name: metrics[name] for name in key_metrics(metrics, chosen)},
        warnings,
        interrupted,
        stopped,
        report.problem,
    )


def _varied(scenario: ScenarioFile, sample: Sample) -> ScenarioFile:
    """Return the scenario of one sample."""
    varied = copy.deepcopy(scenario)
    for override in sample.overrides:
        varied.override(override, "--vary")
    return varied


def _check_keys(scenario: ScenarioFile, tasks: Sequence[RunTask]) -> None:
    """Reject a sweep whose samples all violate the schema, e.g. by an unknown key.

    A wrong value in a single sample is reported in its row.
    """
    first = None
    for task in tasks[:: -(-len(tasks) // _TRIED)]:
        try:
            load_typed(Scenario, task.data, Source(str(scenario.path), task.locations))
            return
        except InputError as error:
            first = first or error
    if first is not None:
        raise first


def _warnings(rows: dict[int, RunRow]) -> list[str]:
    """Return warnings about a sweep."""
    warnings = []
    warned = [i for i in sorted(rows) if rows[i].warnings]
    if warned:
        example = f"run {warned[0]}: {rows[warned[0]].warnings[0]}"
        warnings.append(f"{len(warned)} of {len(rows)} runs have warnings, e.g. {example}")
    revisions = sorted({program_revision(), *(r.revision for r in rows.values() if r.revision)})
    if len(revisions) > 1:
        shown = ", ".join(revision[:12] for revision in revisions)
        warnings.append(f"program and runs are of different revisions: {shown}")
    return warnings


def _description(sweep: Sweep, rows: dict[int, RunRow]) -> str:
    """Return the description for the page."""
    ends = ", ".join(f"{count} {spoken}" for spoken, count in count_ends(rows).items())
    lines = [
        str(sweep.scenario.data.get("description", "")),
        "",
        *(f"varied: {option}" for option in sweep.definition.vary),
        f"{len(rows)} of {len(sweep.samples)} runs: {ends or 'none ended'}.",
    ]
    return "\n".join(lines)
