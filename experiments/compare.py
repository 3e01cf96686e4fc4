"""Several runs on one page."""

import math
from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from experiments.compared_motions import motion_differences
from experiments.results.run_log import RunLog
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.reading import read_text
from reporting.folder import open_results
from reporting.metrics import Metrics
from reporting.page import Report, report_page, write_report
from reporting.style import (
    COLOURS,
    STYLE,
    Drawing,
    Figure,
    make_panels,
    place_legend,
    render,
)

_COMPARED = (
    "max_path_deviation",
    "max_error_from_compliant_reference",
    "max_tangential_error",
    "max_orientation_error",
    "max_external_force",
)
_NEEDED = ("xi", "eta", "eta_p")
_DIFFERENT = "These runs were not asked for the same motion; compare their deviations with care: "
# title, label and factor of what tells orientations in a log
_ORIENTATIONS = {
    "angles": ("Angle about {}", "angle in deg", math.degrees(1.0)),
    "axis": ("Axis of the tool, along {}", "component", 1.0),
}


def write_comparison(folders: Sequence[Path], out: Path) -> Report:
    """Write a page that shows what differs between runs.

    Args:
        folders: Folders of two or more runs.
        out: Folder for the page.

    Returns:
        The page.

    Raises:
        InputError: If a folder holds no run, or fewer than two are given, or ``out`` cannot take
            the page (see :func:`reporting.folder.open_results`).
    """
    if len(folders) < 2:
        raise InputError(f"compare: {len(folders)} run given; two or more are needed")
    logs = {folder.name: _read_log(folder / "log.h5") for folder in folders}
    if len(logs) < len(folders):
        raise InputError("compare: the folders' names must differ; they are the runs' names here")
    metrics = Metrics()
    for folder in folders:
        own = Metrics.read(folder / "metrics.json")
        for name in _COMPARED:
            if name in own:
                metrics.add(f"{folder.name}: {name}", own[name].value, own[name].unit)
    scenarios = {folder.name: read_text(folder / "scenario.yaml") for folder in folders}
    differences = motion_differences(scenarios)
    inputs = [folder / name for folder in folders for name in ("log.h5", "metrics.json")]
    with open_results(out, "comparison", inputs) as results:
        figures = [_deviations(logs)]
        for kind in _ORIENTATIONS:
            if all(f"{kind}_e" in log for log in logs.values()):
                figures.append(_orientations(logs, kind))
        if all("orientation_lead" in log for log in logs.values()):
            figures.append(_leads(logs))
        if all("wrench_ext" in log for log in logs.values()):
            figures.append(_forces(logs))
        first = next(iter(logs.values()))
        motion = "Different motions" if differences else "The same motion"
        page = report_page(
            title=" against ".join(logs),
            kind="Comparison",
            description=f"{motion}, side by side.",
            warnings=[_DIFFERENT + "; ".join(differences) + "."] if differences else [],
            scenario_yaml_text="\n---\n".join(scenarios.values()),
            metrics=metrics,
            figures=figures,
            log_attributes={k: v for k, v in first.attributes.items() if k != "scenario"},
        )
        return write_report(results, figures, page)


def _read_log(path: Path) -> RunLog:
    """A log with the signals that are compared."""
    log = RunLog.read(path)
    for name in _NEEDED:
        if name not in log:
            raise InputError(f"{path}: has no signal {name!r}; allowed: the log of a run")
    return log


def _deviations(logs: dict[str, RunLog]) -> Figure:
    with plt.rc_context(STYLE):
        canvas, (above, below) = make_panels(2)
        for colour, (name, log) in zip(COLOURS, logs.items(), strict=False):
            distance = np.linalg.norm(log["xi"].values, axis=1) * 1e3
            above.plot(log.time, distance, color=colour, label=name)
            error = (log["eta"].values - log["eta_p"].values)[:, 0] * 1e3
            below.plot(log.time, error, color=colour)
        above.set(title="Distance from the path", ylabel="distance in mm")
        below.set(title="Error along the path", ylabel="error in mm")
        place_legend(above)
        caption = "Distance from the path and error along it."
        return render(Drawing("deviations", "Deviations", caption, canvas))


def _leads(logs: dict[str, RunLog]) -> Figure:
    caption = (
        "Angle between the orientation that each law asks for and the one that belongs to the "
        "tool's place on the path: zero where the reference waits."
    )
    return _draw_one(
        {name: np.rad2deg(log["orientation_lead"].values[:, 0]) for name, log in logs.items()},
        logs,
        "angle in deg",
        "Reference orientation ahead of the tool's place",
        ("orientation_lead", "Waiting or running on", caption),
    )


def _forces(logs: dict[str, RunLog]) -> Figure:
    caption = "Size of the force that acts on the tool, not what the sensor makes of it."
    return _draw_one(
        {
            name: np.linalg.norm(log["wrench_ext"].values[:, :3], axis=1)
            for name, log in logs.items()
        },
        logs,
        "force in N",
        "Force on the tool",
        ("forces", "Forces", caption),
    )


def _draw_one(
    signals: dict[str, np.ndarray],
    logs: dict[str, RunLog],
    ylabel: str,
    title: str,
    named: tuple[str, str, str],
) -> Figure:
    """Draw one signal of every run in one panel; ``named`` are name, title, caption."""
    with plt.rc_context(STYLE):
        canvas, (panel,) = make_panels(1)
        for colour, (name, values) in zip(COLOURS, signals.items(), strict=False):
            panel.plot(logs[name].time, values, color=colour, label=name)
        panel.set(title=title, ylabel=ylabel)
        place_legend(panel)
        return render(Drawing(*named, canvas))


def _orientations(logs: dict[str, RunLog], kind: str) -> Figure:
    title, ylabel, factor = _ORIENTATIONS[kind]
    first = next(iter(logs.values()))
    with plt.rc_context(STYLE):
        canvas, panels = make_panels(3)
        for i, (panel, axis) in enumerate(zip(panels, first[f"{kind}_e"].labels, strict=True)):
            for colour, (name, log) in zip(COLOURS, logs.items(), strict=False):
                for suffix, style, what in (("e", "-", "tool"), ("d", "--", "reference")):
                    values = factor * log[f"{kind}_{suffix}"].values[:, i]
                    panel.plot(log.time, values, style, color=colour, label=f"{name}, {what}")
            panel.set(title=title.format(axis), ylabel=ylabel)
        place_legend(panels[0], columns=2)
        caption = (
            "Tool and the reference that each law compares it with. With path following the "
            "reference waits while the tool is held back; with trajectory tracking it runs on."
        )
        return render(Drawing("orientations", "Orientation", caption, canvas))
