"""Path following against trajectory tracking, on equal terms (Sec. 3.8.4)."""

from collections.abc import Callable, Mapping
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

_GAINS = "controller.gains.singular_perturbation.xi.coefficients"
LAWS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "path following": ("pfc_comau_6r", ()),
    "tracking, the same gains": ("ttc_comau_6r", ()),
    "tracking, xi like eta": ("ttc_comau_6r", (f"{_GAINS}=[361, 38]",)),
}
FORCES: Mapping[str, tuple[str, ...]] = {
    "a wrench that slows eta alone": (),
    "a plain force along the tangent": (
        "hold_back.force=0",
        "forces=[{begin: 1.5, end: 2.0, ramp: 0.1, frame: manifold, force: [-180, 0, 0]}]",
    ),
    "no force": ("hold_back.force=0",),
}
_DISTURBED = ("friction.file=comau_racer_1_4", "model_error.mass=0.95")
ROBOTS: Mapping[str, tuple[str, ...]] = {
    "as modelled": (),
    "friction, masses 5 % too low": _DISTURBED,
    "the same, friction observed": (*_DISTURBED, "controller.friction.source=observer"),
}
METRICS = {"max_path_deviation": "m", "max_orientation_error": "rad", "max_tangential_error": "m"}
_DESCRIPTION = (
    "The robot, path and motion of Sec. 3.8.4 under the singular perturbation law, held back by "
    "180 N along the path for half a second. Tracking errors are measured from the point that "
    "moves with time, along the path there and across. Its gains are once those of path "
    "following, and once those of the tangential coordinate in all directions. A plain force at "
    "the tool also bends the arm across and turns it; the wrench that slows eta alone has a "
    "torque beside it that makes up for that. Orientation errors are from the orientation that "
    "each law follows: that of the tool's place on the path, or that of the moving point."
)
# law, force, robot
Case = tuple[str, str, str]


def write_tracking(
    out: Path,
    progress: Callable[[str], None],
    forces: Mapping[str, tuple[str, ...]] = FORCES,
    robots: Mapping[str, tuple[str, ...]] = ROBOTS,
) -> Report:
    """Run both laws under all forces on all robots, on all cores, and write a page.

    Args:
        out: Folder for the page.
        progress: Told one line per run, in the order in which they end.
        forces: Overrides by name.
        robots: Overrides by name.

    Returns:
        The page.

    Raises:
        InputError: If ``out`` cannot take the page (see
            :func:`reporting.folder.open_results`); nothing has been run then.
    """
    scenarios = {
        (law, force, robot): read_scenario(name, [*gains, *forces[force], *robots[robot]])
        for robot in robots
        for force in forces
        for law, (name, gains) in LAWS.items()
    }
    with open_results(out, "study") as results:
        rows = run_side_by_side(scenarios, lambda case, row: progress(_said(case, row)))
        metrics = Metrics()
        for case, row in rows.items():
            for name, unit in METRICS.items():
                key, source = f"{', '.join(case)}: {name}", row.reason or None
                metrics.add(key, row.value(name), unit, source=source)
        overrides = [" ".join(x) for x in (*forces.values(), *robots.values()) if x]
        return write_study_page(
            results,
            title="Path following against trajectory tracking",
            description=_DESCRIPTION,
            overrides=overrides,
            metrics=metrics,
            figures=[_picture(rows)],
        )


def _said(case: Case, row: RunRow) -> str:
    law, force, robot = case
    result = row.reason or f"{row.value('max_path_deviation') * 1e3:8.3f} mm"
    return f"{law:26s} {force:32s} {robot:30s} {result}"


def _picture(rows: Mapping[Case, RunRow]) -> Figure:
    forces, robots = (list(dict.fromkeys(case[i] for case in rows)) for i in (1, 2))
    with plt.rc_context(STYLE):
        canvas = Canvas(figsize=(1.2 * WIDTH, 5.6))
        panels = canvas.subplots(1, 2, sharey=True)
        groups = [(force, robot) for robot in robots for force in forces]
        places = np.arange(len(groups))[::-1].astype(float)
        names = ("max_path_deviation", "max_orientation_error")
        for panel, metric, unit in zip(panels, names, ("mm", "mrad"), strict=True):
            for i, law in enumerate(LAWS):
                values = [rows[law, force, robot].value(metric) * 1e3 for force, robot in groups]
                panel.barh(
                    places + 0.26 * (1 - i), values, height=0.24, color=COLOURS[i], label=law
                )
            panel.set(xscale="log", xlabel=f"{metric.replace('_', ' ')} in {unit}")
            panel.set_yticks(places, [f"{force}\n{robot}" for force, robot in groups])
        handles, labels = panels[0].get_legend_handles_labels()
        canvas.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
        caption = "The largest distance from the path, and the largest error of orientation."
        return render(Drawing("tracking", "Deviation of both laws", caption, canvas))
