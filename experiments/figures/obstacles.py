"""What crosses a path: distance, the pace that it leaves, the time that it costs."""

import numpy as np

from experiments.results.run_log import RunLog
from reporting.style import COLOURS, INK, REFERENCE, Drawing, make_panels, place_legend, shade

_PASSES, _WAITS = "#DCFCE7", "#FEF3C7"
_RESTING = 0.05  # of the planned pace, below which the reference waits
_FAR = 2.0  # m, distances above which nobody needs to see


def draw_obstacles(log: RunLog) -> Drawing:
    """Distance between arm and obstacles, pace of the reference, and time lost.

    Args:
        log: With ``obstacle_distance``, ``waiting_pace``, ``permitted_pace``, ``time_lost``.
    """
    canvas, (distance, pace, lost) = make_panels(3, height=2.4)
    signal = log["obstacle_distance"]
    for k, column in enumerate(signal.values.T):
        name = signal.labels[k].replace("_", " ")
        distance.plot(log.time, column, color=COLOURS[k % len(COLOURS)], label=name)
    if signal.limits is not None:
        margin = float(signal.limits[0, 0])
        distance.axhline(margin, linestyle="--", color=INK, linewidth=1.1, label="margin")
    top = min(_FAR, 1.05 * float(np.nanmax(signal.values, initial=0.1)))
    distance.set(ylabel="distance in m", title="Arm and obstacles", ylim=(0.0, top))
    going = log["waiting_pace"].values[:, 0]
    permitted = log["permitted_pace"].values[:, 0]
    pace.plot(log.time, going, color=COLOURS[0], label="pace")
    pace.plot(log.time, permitted, "--", color=REFERENCE, label="permitted, whatever they do")
    pace.set(ylabel="pace / planned", title="Pace of the reference")
    pace.set_ylim(min(-0.02, 1.05 * float(going.min(initial=0.0))), 1.05)
    lost.plot(log.time, log["time_lost"].values[:, 0], color=COLOURS[1])
    lost.set(ylabel="time in s", title="Time lost", ylim=(0.0, None))
    running = np.flatnonzero(going)
    waits = np.abs(going) < _RESTING
    if running.size:
        waits[: running[0]] = waits[running[-1] :] = False
    shade([distance, pace, lost], log.time, waits, "waits", _WAITS)
    for panel in (distance, pace):
        place_legend(panel)
    caption = (
        "True distance between the surfaces of the arm and of what crosses its path; the share of "
        "its planned pace at which the reference moves, and what could still be stopped in time; "
        "how much later than planned the reference is."
    )
    return Drawing("obstacles", "Obstacles", caption, canvas)
