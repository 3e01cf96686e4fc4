"""Where a ball is in the cross-section of its notch."""

import numpy as np
from matplotlib.figure import Figure as Canvas

from experiments.results.run_log import RunLog
from reporting.style import COLOURS, INK, REFERENCE, Drawing

_SIZE = 5.0  # inches
_MARGIN = 1.25  # of the picture, beyond the farthest point


def draw_notch_position(log: RunLog) -> Drawing:
    """Way of the ball's centre in the notch, with the circle in which it touches nothing."""
    signal = log["notch_position"]
    left, above = 1e3 * signal.values.T
    canvas = Canvas(figsize=(_SIZE, _SIZE))
    panel = canvas.subplots()
    panel.plot(-left, above, color=COLOURS[0], linewidth=1.0, label="centre of the ball")
    panel.plot(-left[:1], above[:1], "o", color=COLOURS[2], label="start")
    reach = float(np.nanmax(np.abs(signal.values))) * 1e3
    if signal.limits is not None:
        free = 1e3 * float(np.max(signal.limits))
        angle = np.linspace(0.0, 2.0 * np.pi, 181)
        panel.plot(
            free * np.cos(angle), free * np.sin(angle), "--", color=INK, label="free of contact"
        )
        reach = max(reach, free)
    for draw_axis in (panel.axhline, panel.axvline):
        draw_axis(0.0, color=REFERENCE, linewidth=0.8)
    span = _MARGIN * reach
    panel.set(xlim=(-span, span), ylim=(-span, span), aspect="equal")
    panel.set(xlabel="to the right of the notch's axis in mm", ylabel="above it in mm")
    panel.set_title("Ball in the notch, seen along the path")
    panel.legend(loc="upper right")
    return Drawing(
        "notch",
        "Ball in the notch",
        "Centre of the ball in the cross-section of the notch; outside the dashed circle its soft "
        "shell is pressed.",
        canvas,
    )
