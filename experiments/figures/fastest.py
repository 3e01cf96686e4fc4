"""The fastest motion: its speed along the way, and what limits it there."""

import numpy as np

from experiments.results.run_log import RunLog
from reporting.style import COLOURS, REFERENCE, Drawing, make_panels, place_legend


def draw_fastest(log: RunLog) -> Drawing:
    """Speed of the fastest motion over the way, coloured by its limit; how near each of them is.

    Args:
        log: With ``speed_planned``, ``limited_by`` and ``limit_shares``.
    """
    speed, shares = log["speed_planned"].values[:, 0], log["limit_shares"]
    limits = log["limited_by"]
    number = limits.values[:, 0].astype(int)
    way = np.concatenate([[0.0], np.cumsum(np.diff(log.time) * (speed[1:] + speed[:-1]) / 2.0)])
    canvas, panels = make_panels(2)
    upper, lower = panels
    upper.plot(way, speed, color=REFERENCE, linewidth=0.8)
    moving = speed > 0.0
    for k, value in enumerate(np.unique(number[moving & (number > 0)])):
        there = moving & (number == value)
        name = limits.labels[value].replace("_", " ")
        colour = COLOURS[k % len(COLOURS)]
        upper.plot(way, np.where(there, speed, np.nan), color=colour, linewidth=2.6, label=name)
    upper.set(ylabel="speed in m/s", ylim=(0.0, None), title="Speed, by what limits it")
    place_legend(upper)
    for k, name in enumerate(shares.labels):
        taken = shares.values[:, k]
        if taken[moving].max(initial=0.0) > 0.0:
            lower.plot(way[moving], taken[moving], color=COLOURS[k % len(COLOURS)], label=name)
    lower.set(
        xlabel="way along the reference in m",
        ylabel="taken / allowed",
        ylim=(0.0, 1.1),
        title="Largest share of what is allowed",
    )
    place_legend(lower)
    caption = (
        "Speed of the reference along its way. Colours: the limit of a drive, as it is believed, "
        "that allows no more: its torque, its joint's speed or the rate of its torque; or the "
        "largest velocity of the tool. Below: what the motion takes of each kind of limit."
    )
    return Drawing("fastest", "The fastest motion and its limits", caption, canvas)
