"""Study of two arms: required knowledge of the workpiece's motion over speed."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure as Canvas

from experiments.scenario_file import read_scenario
from experiments.studies.study_page import write_study_page
from experiments.sweep.many import run_side_by_side
from experiments.sweep.worker import RunRow
from reporting.folder import open_results
from reporting.metrics import Metrics
from reporting.page import Report
from reporting.style import COLOURS, STYLE, WIDTH, Drawing, Figure, render

_SCENARIO, _METRIC = "pfc_two_arms", "max_path_deviation"
# speed and acceleration of the tool on the workpiece, and of the workpiece robot at that speed
_SPEED, _ACCELERATION, _HOLDER_SPEED, _HOLDER_ACCELERATION = 0.3, 0.8, 0.144853, 0.386275
SPEEDS = (0.1, 0.2, 0.3, 0.4)
SOURCES: Mapping[str, tuple[str, ...]] = {
    "actual derivatives": (),
    "measured pose, planned derivatives": ("holder.derivatives=planned",),
    "second difference of poses": ("holder.derivatives=differenced", "holder.highest=2"),
    "first difference of poses": ("holder.derivatives=differenced", "holder.highest=1"),
    "pose only": ("holder.derivatives=none",),
}
_EXACT = tuple(
    f"{robot}{key}={{}}"
    for robot in ("", "holder.")
    for key in ("encoders", "friction", "model_error")
)
_COARSE = tuple(
    f"{robot}encoders.{side}_increments=[400000]"
    for robot in ("", "holder.")
    for side in ("motor", "link")
)
_OBSERVED = "controller.external_torque={source: observed, bandwidth: 100}"
WORLDS: Mapping[str, tuple[str, ...]] = {
    "exact models and sensors": _EXACT,
    "errors, friction, encoders": (),
    "encoders ten times coarser": _COARSE,
    "workpiece robot with force of 60 N": (
        "forces=[{begin: 0.5, end: 1000, ramp: 0.2, force: [0, 0, 60]}]",
        _OBSERVED,
    ),
}
_DESCRIPTION = (
    "One elastic arm turns a pipe, the other follows the seam of its branch, at increasing speed. "
    "Its law receives the measured pose of the pipe, and derivatives of the pose from five "
    "sources. Models and sensors are exact, or have the errors of pfc_two_arms, or encoders with a "
    "tenth of the increments, or there is an unmodelled process force on the pipe. Crosses are "
    "runs stopped by a fault."
)
# world, source, speed [m/s]
Case = tuple[str, str, float]


def write_two_arms(
    out: Path,
    progress: Callable[[str], None],
    worlds: Mapping[str, tuple[str, ...]] = WORLDS,
    sources: Mapping[str, tuple[str, ...]] = SOURCES,
    speeds: Sequence[float] = SPEEDS,
) -> Report:
    """Run two arms with all sources in all worlds at all speeds, on all cores, and write a page.

    Args:
        out: Folder for the page.
        progress: Receives one line per run, in the order in which they end.
        worlds: Overrides by name.
        sources: Overrides by name.
        speeds: Speeds of the tool on the workpiece [m/s].

    Returns:
        The page.

    Raises:
        InputError: If ``out`` cannot take the page (see
            :func:`reporting.folder.open_results`); nothing has been run then.
    """
    scenarios = {
        (world, source, speed): read_scenario(_SCENARIO, [*at_speed(speed), *changes, *own])
        for world, changes in worlds.items()
        for source, own in sources.items()
        for speed in speeds
    }
    with open_results(out, "study") as results:
        rows = run_side_by_side(scenarios, lambda case, row: progress(_row_text(case, row)))
        metrics = Metrics()
        for (world, source, speed), row in rows.items():
            key = f"{world}, {source}, {speed:g} m/s"
            metrics.add(key, row.value(_METRIC), "m", source=row.reason or None)
        changes = [" ".join(x) for x in (*worlds.values(), *sources.values()) if x]
        return write_study_page(
            results,
            title="Required knowledge of a workpiece's motion",
            description=_DESCRIPTION,
            overrides=changes,
            metrics=metrics,
            figures=[_picture(rows)],
        )


def at_speed(speed: float) -> list[str]:
    """Return the overrides for the motion of the shipped scenario at another speed.

    Args:
        speed: Speed of the tool on the workpiece [m/s].
    """
    scaling = speed / _SPEED
    return [
        f"reference.velocity={speed!r}",
        f"reference.acceleration={_ACCELERATION * scaling**2!r}",
        f"holder.reference.velocity={_HOLDER_SPEED * scaling!r}",
        f"holder.reference.acceleration={_HOLDER_ACCELERATION * scaling**2!r}",
        "targets={}",
    ]


def _row_text(case: Case, row: RunRow) -> str:
    world, source, speed = case
    result = row.reason or f"{row.value(_METRIC) * 1e3:9.5f} mm"
    return f"{world:36s} {source:32s} {speed:4.2f} m/s {result}"


def _picture(rows: Mapping[Case, RunRow]) -> Figure:
    worlds, sources = (list(dict.fromkeys(case[i] for case in rows)) for i in (0, 1))
    with plt.rc_context(STYLE):
        columns = min(2, len(worlds))
        lines = -(-len(worlds) // columns)
        canvas = Canvas(figsize=(1.2 * WIDTH, 0.8 + 2.6 * lines))
        panels = canvas.subplots(lines, columns, sharex=True, squeeze=False).ravel()
        for panel, world in zip(panels, worlds, strict=False):
            for source, color in zip(sources, COLOURS, strict=False):
                own = {c[2]: row for c, row in rows.items() if c[:2] == (world, source)}
                speeds = np.array(sorted(own))
                values = np.array([1e3 * own[speed].value(_METRIC) for speed in speeds])
                stopped = np.array([bool(own[speed].reason) for speed in speeds])
                panel.plot(
                    speeds,
                    np.where(stopped, np.nan, values),
                    "o-",
                    markersize=3,
                    color=color,
                    label=source,
                )
                panel.plot(speeds[stopped], np.full(stopped.sum(), 1.0), "x", color=color)
            panel.set(yscale="log", title=world, xlabel="speed on the workpiece in m/s")
            panel.set(ylabel="largest deviation in mm")
        handles, labels = panels[0].get_legend_handles_labels()
        canvas.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False)
        caption = "Largest distance of the tool from the seam, from actual joint positions."
        drawing = Drawing(
            "two_arms_study", "Deviation by knowledge of the workpiece's motion", caption, canvas
        )
        return render(drawing)
