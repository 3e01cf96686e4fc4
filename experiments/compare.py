"""Several runs on one page."""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from experiments.compared_motions import motion_differences
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.reading import read_text
from reporting import style
from reporting.folder import open_results
from reporting.metrics import Metrics
from reporting.page import Page, Report

# lines of a panel by the end of their labels
Lines = Mapping[str, Callable[[RunLog], FloatArray]]

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
        first = next(iter(logs.values()))
        motion = "Different motions" if differences else "The same motion"
        return Page(
            title=" against ".join(logs),
            kind="Comparison",
            description=f"{motion}, side by side.",
            warnings=[_DIFFERENT + "; ".join(differences) + "."] if differences else [],
            scenario_yaml_text="\n---\n".join(scenarios.values()),
            metrics=metrics,
            figures=_figures(logs),
            log_attributes={k: v for k, v in first.attributes.items() if k != "scenario"},
        ).write(results)


def _read_log(path: Path) -> RunLog:
    """A log with the signals that are compared."""
    log = RunLog.read(path)
    for name in _NEEDED:
        if name not in log:
            raise InputError(f"{path}: has no signal {name!r}; allowed: the log of a run")
    return log


def _figures(logs: Mapping[str, RunLog]) -> list[style.Figure]:
    """Draw what all runs have signals for."""
    figures = [
        _draw(
            logs,
            ("deviations", "Deviations", "Distance from the path and error along it."),
            [
                (
                    "Distance from the path",
                    "distance in mm",
                    {"": lambda log: 1e3 * log.norm("xi")},
                ),
                (
                    "Error along the path",
                    "error in mm",
                    {"": lambda log: 1e3 * (log["eta"].values - log["eta_p"].values)[:, 0]},
                ),
            ],
        )
    ]
    first, shared = next(iter(logs.values())), set.intersection(*map(set, logs.values()))
    caption = (
        "Tool and the reference that each law compares it with. With path following the "
        "reference waits while the tool is held back; with trajectory tracking it runs on."
    )
    for kind, (title, ylabel, factor) in _ORIENTATIONS.items():
        if f"{kind}_e" in shared:
            panels = [
                (title.format(axis), ylabel, _tool_and_reference(kind, i, factor))
                for i, axis in enumerate(first[f"{kind}_e"].labels)
            ]
            figures.append(_draw(logs, ("orientations", "Orientation", caption), panels))
    if "orientation_lead" in shared:
        title = "Reference orientation ahead of the tool's place"
        caption = (
            "Angle between the orientation that each law asks for and the one that belongs to the "
            "tool's place on the path: zero where the reference waits."
        )
        lead = {"": lambda log: np.rad2deg(log["orientation_lead"].values[:, 0])}
        texts = ("orientation_lead", "Waiting or running on", caption)
        figures.append(_draw(logs, texts, [(title, "angle in deg", lead)]))
    if "wrench_ext" in shared:
        caption = "Size of the force that acts on the tool, not what the sensor makes of it."
        force = {"": lambda log: np.linalg.norm(log["wrench_ext"].values[:, :3], axis=1)}
        texts = ("forces", "Forces", caption)
        figures.append(_draw(logs, texts, [("Force on the tool", "force in N", force)]))
    return figures


def _tool_and_reference(kind: str, column: int, factor: float) -> Lines:
    return {
        ", tool": lambda log: factor * log[f"{kind}_e"].values[:, column],
        ", reference": lambda log: factor * log[f"{kind}_d"].values[:, column],
    }


def _draw(
    logs: Mapping[str, RunLog],
    texts: tuple[str, str, str],
    panels: Sequence[tuple[str, str, Lines]],
) -> style.Figure:
    """Draw signals of all runs, a colour for each.

    Args:
        logs: Log of each run.
        texts: Name, title and caption.
        panels: Title, label of the vertical axis, and lines of each panel, the second one dashed.
    """
    with style.styled():
        canvas, drawn = style.make_panels(len(panels))
        for panel, (title, ylabel, lines) in zip(drawn, panels, strict=True):
            for k, (run, log) in enumerate(logs.items()):
                for line, (of, values) in zip(("-", "--"), lines.items(), strict=False):
                    panel.plot(log.time, values(log), line, color=f"C{k}", label=f"{run}{of}")
            panel.set(title=title, ylabel=ylabel)
        style.place_legend(drawn[0], columns=len(panels[0][2]) if len(panels[0][2]) > 1 else None)
        return style.render(style.Drawing(*texts, canvas))
