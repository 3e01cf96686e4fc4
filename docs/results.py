"""The table of docs/results.md: what all shipped scenarios give.

    python -m docs.results [--duration S] [scenario ..]     # writes the table anew

Every scenario runs under every law that it has targets for, without figures and recordings, on all
cores. What a run gave is kept in out/results/ and not run again as long as the revision of the
program is the same and nothing differs from it. A scenario that was not run says so.
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
KEPT = ROOT / "out" / "results"
BEGIN, END = "<!-- what make results writes begins -->", "<!-- and ends -->"
# how far a tool is from where it should be: the first of them that a run has a target for, or has
DEVIATIONS = (
    "deepest_violation",
    "max_error_from_compliant_reference",
    "max_path_deviation",
)
_HEAD = (
    "scenario",
    "law",
    "what it is",
    "deviation",
    "target",
    "further targets",
    "pace",
    "status",
)
NOT_RUN = "not run"
_ROUNDS = 10  # of the fixed piece of work, before a run and after it


@dataclass(frozen=True)
class Case:
    """A scenario under a law.

    Attributes:
        scenario: Its name.
        law: The law.
        description: What it is, in a sentence.
        overrides: What makes the law that of the scenario.
    """

    scenario: str
    law: str
    description: str
    overrides: tuple[str, ...]

    @property
    def file(self) -> Path:
        """Where its outcome is kept."""
        return KEPT / f"{self.scenario}.{self.law}.json"

    def read(self) -> ScenarioFile:
        """Return the scenario."""
        return read_scenario(self.scenario, list(self.overrides))


@dataclass(frozen=True)
class Outcome:
    """What a run gave.

    Attributes:
        row: Its row.
        work: How long the fixed piece of work took around it [s].
    """

    row: RunRow
    work: float

    @property
    def pace(self) -> float:
        """Simulated time in the time of the fixed piece of work [s]."""
        return self.row.metrics["real_time_factor"].value * self.work


def cases(names: Sequence[str] = ()) -> list[Case]:
    """Return scenarios and their laws, the one that is shipped first.

    Args:
        names: Of the scenarios; all that are shipped if there is none.
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
    """Run a scenario beside the fixed piece of work.

    Args:
        case: The scenario and its law.
        duration: How long it is simulated [s]; None as long as it says.
    """
    before = _work()
    row = run_task(RunTask.of(case.read(), duration))
    return Outcome(row, (before + _work()) / 2.0)


def _work() -> float:
    """Return how long a fixed piece of work takes by the clock that runs go by [s]."""
    begin = time.perf_counter()
    for _ in range(_ROUNDS):
        machine()
    return (time.perf_counter() - begin) / _ROUNDS


def run_all(
    wanted: Sequence[Case], duration: float | None = None, console: Console | None = None
) -> dict[Case, Outcome]:
    """Run scenarios on all cores, those whose outcome is kept excepted.

    Args:
        wanted: The scenarios.
        duration: How long each is simulated [s], and then not kept; None as long as it says.
        console: Told one line per run, in the order in which they end.
    """
    keeps, revision = duration is None, git_revision()
    outcomes = {case: kept for case in wanted if keeps and (kept := _kept(case, revision))}
    left = [case for case in wanted if case not in outcomes]
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # of the processes that are started
    workers = max(1, min(count_cores(), len(left)))
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        running = {pool.submit(run_case, case, duration): case for case in left}
        for ended in as_completed(running):
            case, outcome = running[ended], ended.result()
            outcomes[case] = outcome
            if keeps:
                _keep(case, outcome)
            if console is not None:
                said = outcome.row.reason or outcome.row.status
                console.print(f"{case.scenario:28s} {case.law:22s} {said}")
    return outcomes


def _keep(case: Case, outcome: Outcome) -> None:
    case.file.parent.mkdir(parents=True, exist_ok=True)
    data = {"row": outcome.row.to_data(), "work": outcome.work}
    case.file.write_text(json.dumps(data), encoding="utf-8")


def _kept(case: Case, revision: str) -> Outcome | None:
    """Return what is kept of a case, if the same run would give the same."""
    if not case.file.is_file() or revision == "unknown" or revision.endswith("+dirty"):
        return None
    data = json.loads(case.file.read_text(encoding="utf-8"))
    row = RunRow.from_data(data["row"])
    return Outcome(row, data["work"]) if row.is_final and row.revision == revision else None


def table(wanted: Sequence[Case], outcomes: Mapping[Case, Outcome]) -> str:
    """Return all scenarios as a table in Markdown.

    Args:
        wanted: Its rows.
        outcomes: What was run of them.
    """
    lines = [_line(_HEAD), _line(["---"] * len(_HEAD))]
    for case in wanted:
        outcome = outcomes.get(case)
        cells = [""] * 4 + [NOT_RUN] if outcome is None else _cells(outcome)
        lines.append(_line([f"`{case.scenario}`", f"`{case.law}`", case.description, *cells]))
    return "\n".join(lines)


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cell.replace('|', '/') for cell in cells)} |"


def _cells(outcome: Outcome) -> list[str]:
    """Return what a run gave: deviation, its target, further ones, pace, status."""
    metrics = outcome.row.metrics
    there = [name for name in DEVIATIONS if name in metrics]
    name = next(
        (name for name in there if metrics[name].passed is not None), next(iter(there), None)
    )
    judged = {key: m for key, m in metrics.items() if m.passed is not None and key != name}
    others = [f"`{key}` {_value(m)} ({_bound(m)})" for key, m in judged.items()]
    pace = _rounded(outcome.pace, "s") if "real_time_factor" in metrics else ""
    deviation = (
        ["", ""] if name is None else [_deviation(name, metrics[name]), _bound(metrics[name])]
    )
    return [*deviation, "; ".join(others), pace, _status(outcome.row, metrics)]


def _deviation(name: str, metric: Metric) -> str:
    short = {
        "deepest_violation": " deep",
        "max_error_from_compliant_reference": " from the reference that yields",
    }
    return _value(metric) + short.get(name, "")


def _value(metric: Metric) -> str:
    return _rounded(metric.value, metric.unit)


def _rounded(value: float, unit: str) -> str:
    return format_quantity(float(f"{value:.2g}"), unit)


def _bound(metric: Metric) -> str:
    """Return what is asked of a metric; words as they stand."""
    if metric.bound is None:
        return metric.target or "none"
    comparison, number = metric.bound
    sign = {"<": "<", "<=": "≤", ">": ">", ">=": "≥"}[comparison]
    return f"{sign} {format_quantity(number, metric.unit)}"


def _status(row: RunRow, metrics: Metrics) -> str:
    missed = [name for name, metric in metrics.items() if metric.passed is False]
    if row.status != COMPLETED:
        return f"{row.status}: {row.reason}"
    return f"missed: {', '.join(missed)}" if missed else "kept"


def page(text: str, wanted: Sequence[Case], outcomes: Mapping[Case, Outcome]) -> str:
    """Return the page with its table anew.

    Args:
        text: The page as it is.
        wanted: Rows of the table.
        outcomes: What was run of them.

    Raises:
        ValueError: If the page does not say where the table stands.
    """
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{PAGE.name}: no lines {BEGIN} and {END}")
    said = f"{len(outcomes)} of {len(wanted)} runs; revision {_revisions(outcomes)}"
    if outcomes:
        work = statistics.median(outcome.work for outcome in outcomes.values())
        said += f"; the fixed piece of work took {1e3 * work:.0f} ms (median)"
    return f"{before}{begin}\n\n{table(wanted, outcomes)}\n\n{said}.\n\n{end}{after}"


def _revisions(outcomes: Mapping[Case, Outcome]) -> str:
    found = dict.fromkeys(outcome.row.revision for outcome in outcomes.values())
    return ", ".join(revision[:12] + revision[40:] for revision in found) or "none"


def main() -> None:
    """Run what is asked for, and write the page."""
    parser = ArgumentParser(prog="python -m docs.results")
    parser.add_argument("scenarios", nargs="*", help="shipped ones; all by default")
    parser.add_argument("--duration", type=float, help="simulated time [s]; nothing is kept then")
    given = parser.parse_args()
    console = Console(highlight=False)
    outcomes = run_all(cases(given.scenarios), given.duration, console)
    text = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(page(text, cases(), outcomes), encoding="utf-8")
    console.print(f"{PAGE}: {len(outcomes)} runs")


if __name__ == "__main__":
    main()
