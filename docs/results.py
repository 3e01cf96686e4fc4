"""The table of docs/results.md: results of all shipped scenarios.

    python -m docs.results [--duration S] [scenario ..]     # rewrites the table

Every scenario runs under every law that it has targets for, without figures and recordings, on all
cores. Outcomes are stored in out/results/ and reused as long as the revision of the program is the
same and its tree is clean. The table marks scenarios that were not run.
"""

import json
import os
import statistics
import time
from argparse import ArgumentParser
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

from rich.console import Console

from experiments.scenario_file import ScenarioFile, list_scenarios, read_scenario
from experiments.sweep.worker import COMPLETED, RunRow, RunTask, run_task
from reporting.metrics import Metric, Metrics, format_quantity
from reporting.processes import count_cores
from reporting.provenance import git_revision
from tests.benchmarks.paces import machine

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "results.md"
STORE = ROOT / "out" / "results"
BEGIN, END = "<!-- begin: make results -->", "<!-- end: make results -->"
# candidates for the deviation: the first with a target in the run, otherwise the first in the run
DEVIATIONS = (
    "deepest_violation",
    "max_error_from_compliant_reference",
    "max_path_deviation",
)
_HEAD = (
    "scenario",
    "law",
    "description",
    "deviation",
    "target",
    "further targets",
    "speed",
    "status",
)
NOT_RUN = "not run"
_ROUNDS = 10  # repetitions of the fixed work before a run and after it


@dataclass(frozen=True)
class Case:
    """A scenario under a law.

    Attributes:
        scenario: Name of the scenario.
        law: The law.
        description: Description in a sentence.
        overrides: Overrides that select the law.
    """

    scenario: str
    law: str
    description: str
    overrides: tuple[str, ...]

    @property
    def file(self) -> Path:
        """File of the stored outcome."""
        return STORE / f"{self.scenario}.{self.law}.json"

    def read(self) -> ScenarioFile:
        """Return the scenario."""
        return read_scenario(self.scenario, list(self.overrides))


@dataclass(frozen=True)
class Outcome:
    """Outcome of a run.

    Attributes:
        row: Row of the run.
        work: Duration of the fixed work around the run [s].
    """

    row: RunRow
    work: float

    @property
    def speed(self) -> float:
        """Simulated time per duration of the fixed work [s]."""
        return self.row.metrics["real_time_factor"].value * self.work


def cases(names: Sequence[str] = ()) -> list[Case]:
    """Return scenarios and their laws, the law of the scenario file first.

    Args:
        names: Names of the scenarios; empty for all shipped ones.
    """
    found = []
    for entry in list_scenarios():
        if names and entry.name not in names:
            continue
        data = read_scenario(entry.name, []).data
        shipped = data["controller"]["law"]
        for law in dict.fromkeys([shipped, *data.get("targets", {})]):
            changes = () if law == shipped else (f"controller.law={law}",)
            found.append(Case(entry.name, law, entry.description, changes))
    return found


def run_case(case: Case, duration: float | None = None) -> Outcome:
    """Run a scenario, with the fixed work before and after it.

    Args:
        case: The scenario and its law.
        duration: Simulated time [s]; None for the scenario's own.
    """
    before = _work()
    row = run_task(RunTask.of(case.read(), duration))
    return Outcome(row, (before + _work()) / 2.0)


def _work() -> float:
    """Return the duration of the fixed work, by the clock of the real-time factor [s]."""
    begin = time.perf_counter()
    for _ in range(_ROUNDS):
        machine()
    return (time.perf_counter() - begin) / _ROUNDS


def run_all(
    requested: Sequence[Case], duration: float | None = None, console: Console | None = None
) -> dict[Case, Outcome]:
    """Run scenarios on all cores, except those with a stored outcome.

    Args:
        requested: The scenarios.
        duration: Simulated time of each [s], whose outcome is then not stored; None for their own.
        console: Console for one line per run, in the order in which they end.
    """
    stores, revision = duration is None, git_revision()
    outcomes = {case: found for case in requested if stores and (found := _stored(case, revision))}
    left = [case for case in requested if case not in outcomes]
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # for the worker processes
    workers = max(1, min(count_cores(), len(left)))
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        running = {pool.submit(run_case, case, duration): case for case in left}
        for ended in as_completed(running):
            case, outcome = running[ended], ended.result()
            outcomes[case] = outcome
            if stores:
                _store(case, outcome)
            if console is not None:
                status = outcome.row.reason or outcome.row.status
                console.print(f"{case.scenario:28s} {case.law:22s} {status}")
    return outcomes


def _store(case: Case, outcome: Outcome) -> None:
    case.file.parent.mkdir(parents=True, exist_ok=True)
    data = {"row": outcome.row.to_data(), "work": outcome.work}
    case.file.write_text(json.dumps(data), encoding="utf-8")


def _stored(case: Case, revision: str) -> Outcome | None:
    """Return the stored outcome of a case if it has this revision."""
    if not case.file.is_file() or revision == "unknown" or revision.endswith("+dirty"):
        return None
    data = json.loads(case.file.read_text(encoding="utf-8"))
    row = RunRow.from_data(data["row"])
    return Outcome(row, data["work"]) if row.is_final and row.revision == revision else None


def table(requested: Sequence[Case], outcomes: Mapping[Case, Outcome]) -> str:
    """Return all scenarios as a table in Markdown.

    Args:
        requested: Rows of the table.
        outcomes: Outcomes of the completed runs.
    """
    lines = [_line(_HEAD), _line(["---"] * len(_HEAD))]
    for case in requested:
        outcome = outcomes.get(case)
        cells = [""] * 4 + [NOT_RUN] if outcome is None else _cells(outcome)
        lines.append(_line([f"`{case.scenario}`", f"`{case.law}`", case.description, *cells]))
    return "\n".join(lines)


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cell.replace('|', '/') for cell in cells)} |"


def _cells(outcome: Outcome) -> list[str]:
    """Return the results of a run: deviation, its target, further targets, speed, status."""
    metrics = outcome.row.metrics
    there = [name for name in DEVIATIONS if name in metrics]
    name = next(
        (name for name in there if metrics[name].passed is not None), next(iter(there), None)
    )
    judged = {key: m for key, m in metrics.items() if m.passed is not None and key != name}
    others = [f"`{key}` {_value(m)} ({_bound(m)})" for key, m in judged.items()]
    speed = _rounded(outcome.speed, "s") if "real_time_factor" in metrics else ""
    deviation = (
        ["", ""] if name is None else [_deviation(name, metrics[name]), _bound(metrics[name])]
    )
    return [*deviation, "; ".join(others), speed, _status(outcome.row, metrics)]


def _deviation(name: str, metric: Metric) -> str:
    short = {
        "deepest_violation": " deep",
        "max_error_from_compliant_reference": " from the compliant reference",
    }
    return _value(metric) + short.get(name, "")


def _value(metric: Metric) -> str:
    return _rounded(metric.value, metric.unit)


def _rounded(value: float, unit: str) -> str:
    return format_quantity(float(f"{value:.2g}"), unit)


def _bound(metric: Metric) -> str:
    """Return the target of a metric; words unchanged."""
    if metric.bound is None:
        return metric.target or "none"
    comparison, number = metric.bound
    sign = {"<": "<", "<=": "≤", ">": ">", ">=": "≥"}[comparison]
    return f"{sign} {format_quantity(number, metric.unit)}"


def _status(row: RunRow, metrics: Metrics) -> str:
    missed = [name for name, metric in metrics.items() if metric.passed is False]
    if row.status != COMPLETED:
        return f"{row.status}: {row.reason}"
    return f"missed: {', '.join(missed)}" if missed else "passed"


def page(text: str, requested: Sequence[Case], outcomes: Mapping[Case, Outcome]) -> str:
    """Return the page with a new table.

    Args:
        text: Present text of the page.
        requested: Rows of the table.
        outcomes: Outcomes of the completed runs.

    Raises:
        ValueError: If the page lacks the marks of the table.
    """
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{PAGE.name}: no lines {BEGIN} and {END}")
    summary = f"{len(outcomes)} of {len(requested)} runs; revision {_revisions(outcomes)}"
    if outcomes:
        work = statistics.median(outcome.work for outcome in outcomes.values())
        summary += f"; the fixed work took {1e3 * work:.0f} ms (median)"
    return f"{before}{begin}\n\n{table(requested, outcomes)}\n\n{summary}.\n\n{end}{after}"


def _revisions(outcomes: Mapping[Case, Outcome]) -> str:
    found = dict.fromkeys(outcome.row.revision for outcome in outcomes.values())
    return ", ".join(revision[:12] + revision[40:] for revision in found) or "none"


def main() -> None:
    """Run the requested scenarios and write the page."""
    parser = ArgumentParser(prog="python -m docs.results")
    parser.add_argument("scenarios", nargs="*", help="shipped ones; all by default")
    parser.add_argument(
        "--duration", type=float, help="simulated time [s]; outcomes are not stored"
    )
    arguments = parser.parse_args()
    console = Console(highlight=False)
    outcomes = run_all(cases(arguments.scenarios), arguments.duration, console)
    text = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(page(text, cases(), outcomes), encoding="utf-8")
    console.print(f"{PAGE}: {len(outcomes)} runs")


if __name__ == "__main__":
    main()
