"""Registry of the possible signals, metrics and figures of a run, from ``registry.toml``.

It provides units and labels of a log, units and sources of metrics, allowed names of targets,
conditions of figures, ``list --signals``, and ``docs/reference/signals.md``, which it prints.
"""

import re
import sys
import tomllib
from collections.abc import Collection, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

_NUMBER = re.compile(r"_\d+$")  # of a drive
_INTRODUCTION = """# Signals, metrics and figures

Possible results of a run: signals in `log.h5`, each a dataset `[samples, components]` at 1 kHz with
attributes `unit` and `labels`; metrics in `metrics.json`, if the run has what they need, N being
the number of a drive; figures in `figures/`. Units are SI; of two units, the second is for
prismatic joints, and r is the relative degree.

`pfsc list --signals` prints the same, with `--json` as data. `make signals`
generates this page from `reporting/registry.toml`."""
_TABLE = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))


@dataclass(frozen=True)
class KnownSignal:
    """A possible signal of a log.

    Attributes:
        name: Name in the log.
        unit: Unit of all components; several kinds are separated by commas; ``rad|m`` stands for
            revolute or prismatic joints.
        text: Description.
        when: Condition of a log with it; always if empty.
        labels: Names of the components, separated by blanks, or one for all with ``{}`` for a
            number; the signal's own name if empty.
        figures: Figures that show it.
    """

    name: str
    unit: str
    text: str
    when: str = ""
    labels: str = ""
    figures: tuple[str, ...] = ()

    def unit_of(self, turning: Sequence[bool]) -> str:
        """Return the unit for a robot.

        Args:
            turning: Whether each joint is revolute, otherwise prismatic.
        """
        turns, _, slides = self.unit.partition("|")
        if not slides or all(turning):
            return turns
        return f"{turns} or {slides}" if any(turning) else slides

    def labels_of(self, count: int) -> list[str]:
        """Return the names of a number of components."""
        if self.labels and "{}" not in self.labels:
            return self.labels.split()
        if not self.labels and count == 1:
            return [self.name]
        pattern = self.labels or f"{self.name}_{{}}"
        return [pattern.format(number) for number in range(1, count + 1)]


@dataclass(frozen=True)
class KnownMetric:
    """A possible metric of a run.

    Attributes:
        name: Name, with ``{}`` for the number of a drive if each has one.
        unit: SI unit; ``Nm|N`` stands for revolute or prismatic joints.
        text: Description.
        needs: Required signals or properties of a run.
        source: Source of the number, if any.
    """

    name: str
    unit: str
    text: str
    needs: tuple[str, ...] = ()
    source: str | None = None

    def names(self, drives: int) -> list[str]:
        """Return its names for a robot with a number of drives."""
        if "{}" not in self.name:
            return [self.name]
        return [self.name.format(number) for number in range(1, drives + 1)]


@dataclass(frozen=True)
class KnownFigure:
    """A possible figure of a run.

    Attributes:
        name: Name of its file, without suffix.
        text: Description.
        needs: Required signals.
    """

    name: str
    text: str
    needs: tuple[str, ...] = ()


def _rows(kind: str) -> Iterator[dict[str, Any]]:
    for name, row in _TABLE[kind].items():
        lists = {key: tuple(row[key].split()) for key in ("needs", "figures") if key in row}
        yield {"name": name, **row, **lists}


SIGNALS = {row["name"]: KnownSignal(**row) for row in _rows("signals")}
METRICS = {row["name"]: KnownMetric(**row) for row in _rows("metrics")}
FIGURES = {row["name"]: KnownFigure(**row) for row in _rows("figures")}


def find_metric(name: str) -> KnownMetric | None:
    """Return the entry of a metric, also with the number of a drive; None for an unknown name."""
    return METRICS.get(name) or METRICS.get(_NUMBER.sub("_{}", name))


def possible_metrics(known: Collection[str], drives: int) -> list[str]:
    """Return the names of the possible metrics of a run.

    Args:
        known: Its signals, its other properties that metrics need, and metrics known in advance.
        drives: Number of drives.
    """
    return [
        name
        for metric in METRICS.values()
        for name in metric.names(drives)
        if name in known or set(metric.needs) <= set(known)
    ]


def as_data() -> dict[str, list[dict[str, Any]]]:
    """Return all signals, metrics and figures as plain data."""
    return {
        "signals": [asdict(signal) for signal in SIGNALS.values()],
        "metrics": [asdict(metric) for metric in METRICS.values()],
        "figures": [asdict(figure) for figure in FIGURES.values()],
    }


def as_tables() -> dict[str, tuple[Sequence[str], list[Sequence[str]]]]:
    """Return head and rows of the tables of signals, metrics and figures, as text."""
    return {
        "signals": (
            ("Signal", "Unit", "What it is", "When", "Figures"),
            [
                (s.name, _unit(s.unit), s.text, s.when, ", ".join(s.figures))
                for s in SIGNALS.values()
            ],
        ),
        "metrics": (
            ("Metric", "Unit", "What it is", "Needs"),
            [
                (m.name.replace("{}", "N"), _unit(m.unit), m.text, ", ".join(m.needs))
                for m in METRICS.values()
            ],
        ),
        "figures": (
            ("Figure", "Content", "Needs"),
            [(f.name, f.text, ", ".join(f.needs)) for f in FIGURES.values()],
        ),
    }


def as_markdown() -> str:
    """Return the page of all signals, metrics and figures."""
    page = [_INTRODUCTION]
    for kind, (head, rows) in as_tables().items():
        page += [f"\n## {kind.capitalize()}\n", _line(head), _line(["---"] * len(head))]
        page += [_line([f"`{name}`", *row]) for name, *row in rows]
    return "\n".join(page) + "\n"


def as_text() -> str:
    """Return the same in columns."""
    lines = []
    for head, rows in as_tables().values():
        widths = [max(len(row[k]) for row in [head, *rows]) for k in range(len(head))]
        for row in (head, *rows):
            cells = (f"{cell:{width}}" for cell, width in zip(row, widths, strict=True))
            lines.append("  ".join(cells).rstrip())
        lines.append("")
    return "\n".join(lines)


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _unit(unit: str) -> str:
    return unit.replace("|", " or ")


if __name__ == "__main__":
    sys.stdout.write(as_markdown())
