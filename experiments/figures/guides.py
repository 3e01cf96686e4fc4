"""Figures of a tool that several paths attract."""

import numpy as np

from experiments.figures.forces import shade_pushes
from experiments.results.run_log import RunLog
from reporting.style import COLOURS, INK, REFERENCE, Drawing, make_panels, place_legend

MILLI = 1e3


def draw_guides(log: RunLog) -> Drawing:
    """Which guide pulls, the distance from each, the way along it, forces, and the speed."""
    canvas, (which, distance, along, force, speed) = make_panels(5)
    names = log["guide"].labels
    active = log["guide"].values[:, 0]
    which.step(log.time, active, where="post", color=INK)
    which.set(title="Guide that pulls", yticks=range(len(names)), ylim=(-0.3, len(names) - 0.7))
    which.set_yticklabels(names)
    distance.axhline(0.0, color=REFERENCE, linewidth=0.8)
    for k, name in enumerate(names[1:]):
        colour, pulls = COLOURS[k % len(COLOURS)], active == k + 1
        values = MILLI * log["guide_distance"].values[:, k]
        distance.plot(log.time, values, color=colour, linewidth=0.7, alpha=0.6)
        distance.plot(log.time, np.where(pulls, values, np.nan), color=colour, label=name)
        eta = np.where(pulls, log["guide_eta"].values[:, k], np.nan)
        along.plot(log.time, eta, color=colour, label=name)
    distance.set(title="Distance from the guides", ylabel="distance in mm")
    along.set(title="Way along the guide that pulls", ylabel=r"$\eta$ in m")
    pull = np.linalg.norm(log["guide_force"].values, axis=1)
    hand = np.linalg.norm(log["guiding_force"].values, axis=1)
    force.plot(log.time, hand, color=INK, linewidth=0.8, label="of the hand")
    force.plot(log.time, pull, color=COLOURS[1], label="of the guide")
    force.set(title="Forces", ylabel="force in N")
    command = np.linalg.norm(log["velocity_command"].values, axis=1)
    speed.plot(log.time, command, color=COLOURS[0])
    speed.set(title="Speed that is asked of the tool", ylabel="speed in m/s")
    shade_pushes([distance], log)
    for panel in (distance, force):
        place_legend(panel)
    caption = (
        "Which of the paths pulls the tool; how far the tool truly is from each, thick from the "
        "one that pulls; the way along it; forces of the hand and of the guide; and the speed."
    )
    return Drawing("guides", "Paths that attract", caption, canvas)
