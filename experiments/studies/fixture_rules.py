"""The switching rules of the dissertation against the program, where two surfaces meet sharply."""

from collections.abc import Callable, Mapping
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure as Canvas

from experiments.preparation import prepare
from experiments.results.guidance import guidance_metrics
from experiments.results.run_log import RunLog
from experiments.results.run_signals import collect_log
from experiments.scenario_file import read_scenario
from experiments.simulation import simulate
from experiments.studies.study_page import write_study_page
from reporting.folder import open_results
from reporting.metrics import Metrics
from reporting.page import Report
from reporting.style import (
    COLOURS,
    INK,
    STYLE,
    WIDTH,
    Drawing,
    make_panels,
    place_legend,
    render,
)

SCENARIO = "vf_wedge"
_PRINTED = "fixtures.guidance.rules=printed"
RULES: Mapping[str, tuple[str, ...]] = {
    "program": (),
    "printed, d_fr 1 mm": (_PRINTED,),
    "printed, d_fr 5 mm": (_PRINTED, "fixtures.guidance.printed.distance=0.005"),
}
METRICS = {
    "deepest_violation": "m",
    "largest_command_step": "m/s",
    "mode_changes_per_second": "1/s",
    "energy_from_fixtures": "J",
}
_DESCRIPTION = (
    "A hand pulls the tool into the edge between two planes, 35 deg, then upwards, downwards and "
    "along it. The printed rules (Fig. 5.2) let go of a surface whose normal has a part along the "
    "hand's force. At an acute edge that is so of one surface while the force still presses the "
    "tool through the other into it: pulled into the edge, the tool leaves through the wrong "
    "side. The program's multiplier of a surface contains what the other surface takes, and is "
    "zero only where the tool would leave by itself. Robot, friction, servo, bus and sensor are "
    "the same."
)
_SHOWN = 0.03  # m, above and below the edge


class _Line:
    """Passes what is done on as lines, one for each phase."""

    def __init__(self, name: str, tell: Callable[[str], None]) -> None:
        self._name, self._tell, self._phase = name, tell, ""

    def expect(self, duration: float) -> None:
        """Told the simulated time at the end [s], once it is known."""

    def __call__(self, simulated_time: float, phase: str) -> None:
        if phase != self._phase:
            self._phase = phase
            self._tell(f"{self._name}: {phase}")


def write_fixture_rules(
    out: Path,
    progress: Callable[[str], None],
    rules: Mapping[str, tuple[str, ...]] = RULES,
    duration: float | None = None,
) -> Report:
    """Run the wedge under all rules, and write a page.

    Args:
        out: Folder for the page.
        progress: Told what is done, in lines.
        rules: Overrides by name.
        duration: Simulated time [s] instead of the scenario's.

    Returns:
        The page.

    Raises:
        InputError: If ``out`` cannot take the page; nothing has been run then.
    """
    with open_results(out, "study") as results:
        logs = {
            name: _run(overrides, duration, _Line(name, progress))
            for name, overrides in rules.items()
        }
        metrics = Metrics()
        for name, log in logs.items():
            found = guidance_metrics(log)
            for metric, unit in METRICS.items():
                metrics.add(f"{name}: {metric}", found[metric].value, unit)
        with plt.rc_context(STYLE):
            figures = [render(_ways(logs)), render(_distances(logs))]
        return write_study_page(
            results,
            title="Rules of forbidden regions at an acute edge",
            description=_DESCRIPTION,
            overrides=[SCENARIO, *(" ".join(x) for x in rules.values() if x)],
            metrics=metrics,
            figures=figures,
        )


def _run(overrides: tuple[str, ...], duration: float | None, progress: _Line) -> RunLog:
    scenario = read_scenario(SCENARIO, list(overrides))
    prepared = prepare(scenario, duration, recording=False, progress=progress)
    settings, station = prepared.settings, prepared.station
    result = simulate(station, settings.simulation, settings.duration, progress)
    return collect_log(station, result.root)


def _ways(logs: Mapping[str, RunLog]) -> Drawing:
    """The tool's way across the edge, under each of the rules."""
    canvas = Canvas(figsize=(WIDTH, 3.4))
    panels = canvas.subplots(1, len(logs), sharex=True, sharey=True, squeeze=False)[0]
    # both planes contain the edge x = 0.8 m, z = 0.8 m
    edge, angle = np.array([0.8, 0.8]), np.deg2rad(35.0)
    ends = np.array([[0.0, 0.0], [0.2, 0.0]]), np.array([[0.0, 0.0], [0.2, 0.2 * np.tan(angle)]])
    for panel, (name, log), colour in zip(panels, logs.items(), COLOURS, strict=False):
        for line in ends:
            panel.plot(*(1e3 * line.T), color=INK, linewidth=1.2)
        way = log["y_t"].values[:, [0, 2]] - edge
        panel.plot(*(1e3 * way.T), color=colour)
        panel.set(title=name, xlabel="from the edge in mm")
        panel.set(xlim=(-1e3 * _SHOWN, 1e3 * 3 * _SHOWN), ylim=(-1e3 * _SHOWN, 1e3 * 2.5 * _SHOWN))
    panels[0].set(ylabel="height in mm")
    caption = "Across the edge: the tool may be between the two lines, to the right of the edge."
    return Drawing("ways", "Where the tool goes", caption, canvas)


def _distances(logs: Mapping[str, RunLog]) -> Drawing:
    """How deep the tool is in either region."""
    canvas, (depth, mode) = make_panels(2)
    for (name, log), colour in zip(logs.items(), COLOURS, strict=False):
        inside = np.maximum(0.0, -log["region_distance"].values.min(axis=1))
        depth.plot(log.time, np.maximum(1e3 * inside, 1e-4), color=colour, label=name)
        mode.step(log.time, log["mode"].values[:, 0], where="post", color=colour)
    names = next(iter(logs.values()))["mode"].labels
    depth.set(yscale="log", ylim=(1e-4, 1e3), ylabel="depth in mm", title="Depth in a region")
    mode.set(yticks=range(len(names)), title="Mode", ylim=(-0.3, len(names) - 0.7))
    mode.set_yticklabels(names)
    place_legend(depth)
    caption = "How deep the tool is in the region that it may not enter, and what it is led along."
    return Drawing("depth", "Depth and mode", caption, canvas)
