"""A tool that presses on a workpiece: force over time, and over the workpiece."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from experiments.results.press_metrics import TOUCHING, force_error, held_samples
from experiments.results.run_log import RunLog
from reporting.style import (
    BROAD,
    COLOURS,
    REFERENCE,
    Drawing,
    make_panels,
    place_legend,
)

BAND = 2.0  # N, to either side of the reference
_SIZE = (7.0, 4.6)  # inches
_DOT = 7.0  # points^2


def draw_pressing(log: RunLog) -> Drawing:
    """Force along the workpiece's normal with its reference, its error, and what xi does for it."""
    time, force = log.time, log["normal_force"].values[:, 0]
    is_pressed = "press" in log
    canvas, panels = make_panels(3 if is_pressed else 2, height=2.4)
    upper, lower = panels[0], panels[-1]
    if is_pressed:
        press = log["press"].values[:, 0]
        upper.plot(time, press, label="reference", **BROAD)
        _draw_error(panels[1], log)
    upper.plot(time, force, color=COLOURS[0], label="acting")
    upper.set(ylabel="force in N", title="Force along the workpiece's normal")
    lower.axhline(0.0, color=REFERENCE, linewidth=0.8, label="taught surface")
    lower.plot(time, 1e3 * log["xi"].values[:, 0], color=COLOURS[0], label="tool point")
    lower.set(ylabel=r"$\xi$ in mm", title="Distance from the taught surface")
    for panel in panels:
        if panel.get_legend_handles_labels()[1]:
            place_legend(panel)
    caption = (
        "Force with which the workpiece presses back along its normal, and the tool point's "
        "distance from where the surface was taught"
    )
    caption += f"; the band is {BAND:g} N to either side of the full force." if is_pressed else "."
    return Drawing("pressing", "Force on the workpiece", caption, canvas)


def draw_force_map(log: RunLog) -> Drawing:
    """Force along the normal over the workpiece, along the way of the tool on it."""
    force = log["normal_force"].values[:, 0]
    on = force > TOUCHING
    along, across = 1e3 * log["eta"].values[on].T
    canvas = Canvas(figsize=_SIZE)
    panel = canvas.subplots()
    dots = panel.scatter(along, across, c=force[on], s=_DOT, cmap="viridis", linewidths=0.0)
    if "press" in log:
        full = float(log["press"].values.max())
        dots.set_clim(full - BAND, full + BAND)
    canvas.colorbar(dots, ax=panel, label="force in N", extend="both")
    panel.set(xlabel=r"$\eta_1$ in mm", ylabel=r"$\eta_2$ in mm", aspect="equal")
    panel.set_title("Force along the normal over the workpiece")
    caption = "Force on the workpiece along the tool's way, over the tangential coordinates."
    return Drawing("force_map", "Force over the workpiece", caption, canvas)


def _draw_error(panel: Axes, log: RunLog) -> None:
    """Force error while the full force shall keep, in its band."""
    held = held_samples(log)
    error = np.where(held, force_error(log), np.nan)
    panel.axhspan(-BAND, BAND, color=REFERENCE, alpha=0.15, linewidth=0.0)
    panel.axhline(0.0, color=REFERENCE, linewidth=0.8)
    panel.plot(log.time, error, color=COLOURS[0])
    span = max(1.2 * BAND, 1.1 * float(np.nanmax(np.abs(error), initial=0.0)))
    panel.set(ylim=(-span, span), ylabel="error in N", title="Force error after touch-down")
