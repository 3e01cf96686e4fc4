"""Self-contained HTML pages from templates in this folder; inserted text is escaped."""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from reporting.folder import ResultsFolder
from reporting.metrics import Metric, Metrics, format_cell, format_quantity
from reporting.provenance import FIGURES
from reporting.registry import find_metric
from reporting.style import Figure

MAX_CARDS = 8
KEY_FIGURES = 4  # of a brief page, unfolded
_SYMBOLS = {"<=": "≤", ">=": "≥"}
_SIGNS = {"met": "✓", "missed": "✗", "no value": "✗"}


def fill(template: str, **values: Any) -> str:
    """Return a template with its values.

    Args:
        template: Name of its file.
        values: Values by name.
    """
    return _environment().get_template(template).render(values)


@cache
def _environment() -> Environment:
    environment = Environment(
        autoescape=True,
        loader=FileSystemLoader(Path(__file__).parent),
        lstrip_blocks=True,
        trim_blocks=True,
        undefined=StrictUndefined,
    )
    environment.filters |= {
        "base64": lambda data: b64encode(data.encode() if isinstance(data, str) else data).decode(),
        "bound": _bound,
        "cell": format_cell,
        "in_words": _in_words,
        "value": lambda metric: format_quantity(metric.value, metric.unit),
    }
    environment.globals |= {"find_metric": find_metric, "signs": _SIGNS}
    return environment


def _bound(metric: Metric, space: str) -> str:
    """Return the target in the unit of the metric, as text if it is not a comparison."""
    if metric.bound is None:
        return metric.target or ""
    comparison, number = metric.bound
    symbol = _SYMBOLS.get(comparison, comparison)
    return f"{symbol}{space}{format_quantity(number, metric.unit)}"


def _in_words(name: str, unit: str = "") -> str:
    """Return ``controller_tick_us_p99`` as ``Controller tick p99``; a torque in N is a force."""
    words = " ".join(word for word in name.split("_") if word and word != unit)
    if unit == "N":
        words = words.replace("torque", "force")
    return words[:1].upper() + words[1:]


@dataclass(frozen=True)
class Table:
    """A table of a page.

    Attributes:
        title: Title.
        caption: Explanation, one or two sentences.
        head: Names of the columns.
        rows: Cells; numbers are right-aligned.
    """

    title: str
    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str | float]]

    @property
    def columns(self) -> list[tuple[str, bool]]:
        """Name of each column, and whether it contains only numbers."""
        cells = list(zip(*self.rows, strict=True)) or [()] * len(self.head)
        are_numbers = [bool(own) and not any(isinstance(x, str) for x in own) for own in cells]
        return list(zip(self.head, are_numbers, strict=True))


@dataclass(frozen=True)
class Fact:
    """A key result that is not a metric.

    Attributes:
        name: Name.
        value: Value with its unit, as text.
        note: Remark.
    """

    name: str
    value: str
    note: str = ""


@dataclass
class Report:
    """A written report.

    Attributes:
        path: Page; None if it could not be written.
        problem: Files that could not be written, or None; see ``ResultsFolder.explain_problems``.
    """

    path: Path | None
    problem: str | None


@dataclass
class Page:
    """Page of a run with embedded figures and diagram; only the recording is a file of its own.

    Attributes:
        title: Name of the scenario.
        kind: Subject of the page, above its title.
        description: Description of the run, plain text.
        fault: Reason why the run was stopped; None if it completed.
        broken: Missed targets, one phrase each.
        interrupted: Whether the user stopped it.
        warnings: Warnings, one sentence each.
        metrics: All metrics. Those with a target become cards, or the first few if none has one.
        cards: Names of the metrics that become cards, instead.
        facts: Further cards.
        recording: Path of the Meshcat page, relative to this one.
        legend: Colours in the recording, ``#rrggbb``, by the description of their parts.
        figures: Figures in reading order.
        tables: Tables in reading order, after the figures.
        brief: Whether only the key results and the first figures are unfolded.
        commands: Useful command lines, by their purpose.
        commands_title: Title of the commands.
        changed_yaml_text: Keys of the scenario that differ from the defaults.
        details: Title of ``scenario_yaml_text``.
        scenario_yaml_text: Scenario as resolved.
        diagram_svg: Block diagram as SVG text.
        log_attributes: Provenance of the run, see :mod:`reporting.provenance`.
    """

    title: str
    kind: str = "Simulation run"
    description: str = ""
    fault: str | None = None
    broken: Sequence[str] = ()
    interrupted: bool = False
    warnings: Sequence[str] = ()
    metrics: Metrics = field(default_factory=Metrics)
    cards: Sequence[str] | None = None
    facts: Sequence[Fact] = ()
    recording: str | None = None
    legend: Mapping[str, str] = field(default_factory=dict)
    figures: Sequence[Figure] = ()
    tables: Sequence[Table] = ()
    brief: bool = False
    commands: Mapping[str, str] = field(default_factory=dict)
    commands_title: str = "Runs to look at"
    changed_yaml_text: str = ""
    details: str = "Scenario as resolved"
    scenario_yaml_text: str = ""
    diagram_svg: str | None = None
    log_attributes: Mapping[str, str] = field(default_factory=dict)

    def write(self, results: ResultsFolder) -> Report:
        """Write the page and its figures.

        Args:
            results: Folder of the results.
        """
        for figure in self.figures:
            results.write(f"{FIGURES}/{figure.name}.png", figure.png)
        path = results.write("report.html", self.html())
        return Report(path, results.explain_problems())

    def html(self) -> str:
        """Return the page as HTML."""
        return fill("page.html", page=self)

    @property
    def badges(self) -> list[tuple[str, str]]:
        """Class and text of each badge: outcome, and number of targets met."""
        end = ("bad", "✗ interrupted") if self.interrupted else ("good", "✓ completed")
        if self.broken and not self.interrupted:
            end = ("bad", "✗ ended, requirements violated")
        if self.fault:
            end = ("bad", "✗ stopped by fault")
        passed = [metric.passed for metric in self.metrics.values() if metric.judged]
        verdicts = [met for met in passed if met is not None]
        if not verdicts:
            return [end]
        kind = "good" if all(verdicts) else "bad"
        return [end, (kind, f"{sum(verdicts)} of {len(verdicts)} targets met")]

    @property
    def key_metrics(self) -> dict[str, Metric]:
        """Most important metrics."""
        chosen = self.cards
        if chosen is None:
            chosen = [name for name, metric in self.metrics.items() if metric.target is not None]
        names = (chosen or list(self.metrics))[:MAX_CARDS]
        return {name: self.metrics[name] for name in names}

    @property
    def figure_groups(self) -> tuple[Sequence[Figure], Sequence[Figure]]:
        """Unfolded and folded figures."""
        count = KEY_FIGURES if self.brief else len(self.figures)
        return self.figures[:count], self.figures[count:]
