"""Creation of a first scenario, for the command ``init`` and for notebooks."""

import os
from collections import UserList
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from experiments.new_scenario.arm_choice import Ask
from experiments.new_scenario.first_scenario import Choice, FirstScenario, InitOptions
from experiments.scenario_file import expand_home
from pfsc_drake.errors import InputError
from reporting.metrics import Metrics
from reporting.notebook import metrics_table
from reporting.progress import ProgressListener

_DEVIATIONS = ("max_path_deviation", "max_orientation_error", "asked_torque_share")


class Choices(UserList[Choice]):
    """Choices of a first scenario: keys, values and reasons. A notebook shows them as a table."""

    def __str__(self) -> str:
        return "\n".join(f"{row.key:<24} {row.value}  ({row.reason})" for row in self)

    def _repr_html_(self) -> str:
        """Return the choices as a table."""
        cell = 'style="text-align: left; padding: 0.1em 1.5em 0.1em 0"'
        head = "".join(f"<th {cell}>{title}</th>" for title in ("Key", "Value", "Reason"))
        rows = "".join(
            f"<tr><td {cell}><code>{escape(row.key)}</code></td>"
            f"<td {cell}>{escape(row.value)}</td><td {cell}>{escape(row.reason)}</td></tr>"
            for row in self
        )
        return f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"


@dataclass(frozen=True)
class NewScenario:
    """A scenario that :func:`experiments.init` has written after a successful trial run.

    In a notebook it is displayed as tables of its choices and deviations.

    Attributes:
        file: The scenario's YAML file.
        choices: Key, value and reason of each choice.
        deviations: Largest deviations and torque share of the trial run, metrics by name.
        warnings: Warnings of the trial run, one sentence each.
    """

    file: Path
    choices: Choices
    deviations: Metrics
    warnings: list[str] = field(default_factory=list)

    @property
    def summary(self) -> str:
        """The deviations of the trial run in one line."""
        found = [
            f"{name} {metric.value:.3g} {metric.unit.removeprefix('1')}".rstrip()
            for name, metric in self.deviations.items()
        ]
        return f"trial run completed: {', '.join(found)}"

    def _repr_html_(self) -> str:
        """Return choices, warnings and deviations."""
        warnings = "".join(f"<div>⚠ {escape(sentence)}</div>" for sentence in self.warnings)
        title = f"<div><b>{escape(str(self.file))}</b></div>"
        return title + self.choices._repr_html_() + warnings + metrics_table(self.deviations)


def new_file(model: str, points: str, out: str | Path | None, *, replace: bool) -> Path:
    """Return the file of a new scenario; by default MODEL_POINTS.yaml in the current folder.

    Args:
        model: Name or file of the robot model.
        points: File of the points.
        out: The file; None for the default.
        replace: Whether it may exist.

    Raises:
        InputError: If it is no YAML file or exists, or its folder is missing or read-only.
    """
    file = expand_home(Path(out or f"{Path(model).stem}_{Path(points).stem}.yaml"))
    if file.suffix not in (".yaml", ".yml"):
        raise InputError(f"--out {file}: allowed: the name of a new YAML file, FILE.yaml")
    if file.exists() and not (replace and file.is_file()):
        raise InputError(f"{file}: exists; allowed: a new file, --out FILE.yaml")
    if not file.parent.is_dir():
        raise InputError(f"--out {file}: no folder {file.parent}; allowed: one that exists")
    if not os.access(file.parent, os.W_OK):
        raise InputError(f"--out {file}: {file.parent} is not writable; allowed: a writable folder")
    return file


def create_scenario(
    model: str,
    points: str,
    file: Path,
    options: InitOptions,
    *,
    progress: ProgressListener,
    ask: Ask | None = None,
    replace: bool = False,
) -> NewScenario:
    """Write a scenario for a model and points, after a trial run.

    Args:
        model: Name of a shipped model, or a URDF, SDF or MJCF file.
        points: CSV file of points.
        file: YAML file to write, see :func:`new_file`.
        options: Choices of the user.
        progress: Progress listener.
        ask: Returns one of several names; by default the first one.
        replace: Whether the file may exist.

    Raises:
        InputError: If model or points cannot be read, or do not suit each other.
    """
    first = FirstScenario(model, points, file, options, ask or _first)
    outcome = first.find(progress)
    first.write(replace=replace)
    deviations = Metrics({n: outcome.metrics[n] for n in _DEVIATIONS if n in outcome.metrics})
    return NewScenario(file, Choices(first.choices), deviations, outcome.warnings)


def _first(_question: str, names: Sequence[str]) -> str:
    return names[0]
