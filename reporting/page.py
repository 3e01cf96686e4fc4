"""Self-contained HTML pages from templates in this folder; text that is filled in is escaped."""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from reporting.folder import ResultsFolder
from reporting.metrics import Metric, Metrics, format_quantity
from reporting.provenance import FIGURES
from reporting.registry import known_metric
from reporting.style import Figure

MAX_CARDS = 8
_SYMBOLS = {"<=": "≤", ">=": "≥"}
_SIGNS = {"met": "✓", "missed": "✗", "no value": "✗"}


def fill(template: str, **values: Any) -> str:
    """Return a template with its values.

    Args:
        template: Name of its file.
        values: What it is filled with.
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
        "spoken": _spoken,
        "value": lambda metric: format_quantity(metric.value, metric.unit),
    }
    environment.globals |= {"known_metric": known_metric, "signs": _SIGNS}
    return environment


def _bound(metric: Metric, space: str) -> str:
    """Return the target in the unit of the metric, as text where it is no comparison."""
    if metric.bound is None:
        return metric.target or ""
    comparison, number = metric.bound
    symbol = _SYMBOLS.get(comparison, comparison)
    return f"{symbol}{space}{format_quantity(number, metric.unit)}"


def _spoken(name: str, unit: str = "") -> str:
    """``controller_tick_us_p99`` in ``us`` as ``Controller tick p99``; a torque in N is a force."""
    words = " ".join(word for word in name.split("_") if word and word != unit)
    if unit == "N":
        words = words.replace("torque", "force")
    return words[:1].upper() + words[1:]


@dataclass(frozen=True)
class Table:
    """A table of a page.

    Attributes:
        title: A few words.
        caption: What to see in it, one or two sentences.
        head: Names of the columns.
        rows: Their cells; those that are numbers are set as such.
    """

    title: str
    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str | float]]

    @property
    def columns(self) -> list[tuple[str, bool]]:
        """Name of each column, and whether it holds nothing but numbers."""
        cells = list(zip(*self.rows, strict=True)) or [()] * len(self.head)
        are_numbers = [bool(own) and not any(isinstance(x, str) for x in own) for own in cells]
        return list(zip(self.head, are_numbers, strict=True))


@dataclass
class Report:
    """A report as written.

    Attributes:
        path: The page to open; None if it could not be written.
        problem: What could not be written, or None; see ``ResultsFolder.explain_problems``.
    """

    path: Path | None
    problem: str | None


@dataclass
class Page:
    """The page of a run; figures and diagram are inside, only the recording is beside it.

    Attributes:
        title: Name of the scenario.
        kind: What the page is about, above its title.
        description: What was run, plain text.
        fault: Why the run was stopped; None if it completed.
        broken: Targets that were missed, one phrase each.
        interrupted: Whether the user stopped it.
        warnings: What may not have gone as well as hoped, one sentence each.
        metrics: All of them. Those with a target become cards, or the first few if none has one.
        cards: Names of the metrics that become cards, instead.
        recording: Path of the Meshcat page, relative to this one.
        figures: In reading order.
        tables: In reading order, after the figures.
        commands: Command lines worth repeating, by what they are good for.
        details: What ``scenario_yaml_text`` is.
        scenario_yaml_text: The scenario as resolved.
        diagram_svg: The block diagram as SVG text.
        log_attributes: What identifies the run, see :mod:`reporting.provenance`.
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
    recording: str | None = None
    figures: Sequence[Figure] = ()
    tables: Sequence[Table] = ()
    commands: Mapping[str, str] = field(default_factory=dict)
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
        """Class and text of each badge: how the run ended, and how many targets were met."""
        end = ("bad", "✗ interrupted") if self.interrupted else ("good", "✓ completed")
        if self.broken and not self.interrupted:
            end = ("bad", "✗ ended, with promises broken")
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
        """The metrics to look at first."""
        chosen = self.cards
        if chosen is None:
            chosen = [name for name, metric in self.metrics.items() if metric.target is not None]
        names = (chosen or list(self.metrics))[:MAX_CARDS]
        return {name: self.metrics[name] for name in names}
