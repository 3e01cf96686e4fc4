"""Several runs on one page."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.errors import InputError, shorten
from pfsc_drake.yaml.reading import TAG_KEY, parse_yaml, read_text
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
_DIFFERENT = (
    "These runs do not have the same commanded motion; compare their deviations with care: "
)
# title, label and factor of a log's orientation signals
_ORIENTATIONS = {
    "angles": ("Angle about {}", "angle in deg", math.degrees(1.0)),
    "axis": ("Axis of the tool, along {}", "component", 1.0),
}
# keys of a scenario that define the desired motion
_MOTION = ("path", "surface", "reference", "duration")
_FILE = "file"
_MOST = 4  # differences that are named


def write_comparison(folders: Sequence[Path], out: Path) -> Report:
    """Write a page that compares runs.

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
    """Read a log with the compared signals."""
    log = RunLog.read(path)
    for name in _NEEDED:
        if name not in log:
            raise InputError(f"{path}: has no signal {name!r}; allowed: the log of a run")
    return log


def _figures(logs: Mapping[str, RunLog]) -> list[style.Figure]:
    """Draw the figures whose signals all runs have."""
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
        "Tool and reference of each control law. With path following the "
        "reference waits for a delayed tool; with trajectory tracking it continues in time."
    )
    for kind, (title, ylabel, factor) in _ORIENTATIONS.items():
        if f"{kind}_e" in shared:
            panels = [
                (title.format(axis), ylabel, _tool_and_reference(kind, i, factor))
                for i, axis in enumerate(first[f"{kind}_e"].labels)
            ]
            figures.append(_draw(logs, ("orientations", "Orientation", caption), panels))
    if "orientation_lead" in shared:
        title = "Reference orientation ahead of the tool's projection"
        caption = (
            "Angle between the desired orientation of each law and the path's orientation at the "
            "tool's projection: zero where the reference waits."
        )
        lead = {"": lambda log: np.rad2deg(log["orientation_lead"].values[:, 0])}
        texts = ("orientation_lead", "Reference ahead of the tool", caption)
        figures.append(_draw(logs, texts, [(title, "angle in deg", lead)]))
    if "wrench_ext" in shared:
        caption = "Magnitude of the actual force on the tool, without sensor errors."
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
    with style.project_style():
        canvas, drawn = style.make_panels(len(panels))
        for panel, (title, ylabel, lines) in zip(drawn, panels, strict=True):
            for k, (run, log) in enumerate(logs.items()):
                for line, (of, values) in zip(("-", "--"), lines.items(), strict=False):
                    panel.plot(log.time, values(log), line, color=f"C{k}", label=f"{run}{of}")
            panel.set(title=title, ylabel=ylabel)
        style.add_legend(drawn[0], columns=len(panels[0][2]) if len(panels[0][2]) > 1 else None)
        return style.render(style.Drawing(*texts, canvas))


def motion_differences(scenarios: Mapping[str, str]) -> list[str]:
    """Return the differences between the commanded motions of runs, one phrase each.

    Robots, laws, disturbances and contacts are the subject of a comparison; they do not count as
    differences here.

    Args:
        scenarios: Each run's scenario as resolved, by the run's name. Unreadable YAML is ignored.
    """
    known = {}
    for name, text in scenarios.items():
        with suppress(InputError):
            if isinstance(data := parse_yaml(text, name), dict):
                known[name] = data
    runs = list(known)
    found = [
        _values_by_run(key, dict(zip(runs, values, strict=True)))
        for key, values in _unlike("", [{k: d.get(k) for k in _MOTION} for d in known.values()])
    ]
    if len(found) > _MOST:
        more = len(found) - _MOST
        found[_MOST:] = [f"{more} more key{'s' * (more > 1)}"]
    return found


def _unlike(key: str, values: Sequence[Any]) -> Iterator[tuple[str, Sequence[Any]]]:
    """Iterate over keys below a key whose values differ between runs, with these values."""
    first = values[0] if values else None
    if all(value == first for value in values):
        return
    if all(isinstance(value, dict) for value in values):
        tags = {str(value.get(TAG_KEY)) for value in values}
        if len(tags) == 1:
            for below in dict.fromkeys(name for value in values for name in value):
                yield from _unlike(f"{key}.{below}".lstrip("."), [v.get(below) for v in values])
            return
    if key.rpartition(".")[2] == _FILE and _same_content(values):
        return
    yield key, values


def _same_content(files: Sequence[Any]) -> bool:
    """Return whether files have the same content, or the same names if they no longer exist."""
    try:
        return len({read_text(Path(str(file))) for file in files}) == 1
    except InputError:
        return len({Path(str(file)).name for file in files}) == 1


def _values_by_run(key: str, values: Mapping[str, Any]) -> str:
    """Return a phrase with the values of a key by run."""
    runs: dict[str, list[str]] = {}
    for run, value in values.items():
        runs.setdefault(_value_text(value), []).append(run)
    if len(runs) == 1:
        return f"{key} is {next(iter(runs))}, but not the same content"
    return f"{key} is " + ", ".join(
        f"{shown} in {' and '.join(own)}" for shown, own in runs.items()
    )


def _value_text(value: Any) -> str:
    if value is None:
        return "not given"
    if isinstance(value, dict):
        return str(value.get(TAG_KEY) or Path(str(value.get(_FILE) or "another one")).name)
    if isinstance(value, list) and any(isinstance(entry, dict | list) for entry in value):
        return f"{len(value)} entr{'y' if len(value) == 1 else 'ies'}"
    if isinstance(value, str) and "/" in value:
        return Path(value).name
    return shorten(f"{value:g}" if isinstance(value, float) else str(value))
