"""Pressing on a workpiece: normal force and its reference.

Signals used, as in the log: ``normal_force`` and ``press`` [samples, 1] N, ``xi`` [samples, 1] m.
"""

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from diagrams.station import Station
from experiments.results.feature import Feature, Raw
from experiments.results.run_log import FloatArray, RunLog, peak
from reporting import style
from reporting.metrics import Metrics

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TOUCHING = 0.5  # N, least force of a contact
SETTLING = 0.2  # s, settling time after touch-down and full reference
_FULL = 0.999  # of the largest reference, least share of a full one
_SMALL = 0.1  # of the same; overshoot is not evaluated below
BAND = 2.0  # N, to either side of the reference
_SIZE = (7.0, 4.6)  # inches
_DOT = 7.0  # points^2


def add_pressing(log: RunLog, station: Station, raw: Raw) -> None:
    """Add the normal force of a workpiece, and its reference.

    Args:
        log: Log of the run, which is extended.
        station: The station that was simulated.
        raw: Its logged signals.
    """
    if "press" in raw:
        log.add("press", raw["press"])
    workpiece, axes = station.workpiece, station.task.projected_manifold.axes
    if workpiece is None or workpiece.normal(np.eye(3)) is None:
        return
    normals = np.array(
        [workpiece.normal(axes(point).full()) for point in raw["true_points"]]
    ).reshape(-1, 3)
    log.add("normal_force", np.sum(raw["wrench_ext"][:, :3] * normals, axis=1, keepdims=True))


def press_metrics(log: RunLog) -> Metrics:
    """Return the metrics of pressing, none without ``normal_force``."""
    metrics = Metrics()
    if "normal_force" not in log or log.time.size == 0:
        return metrics
    metrics.add("peak_force", peak(log["normal_force"].values))
    if "press" in log:
        metrics.add("touch_down", touch_down(log))
        metrics.add("touch_down_overshoot", touch_down_overshoot(log))
        metrics.add("contact_losses", contact_losses(log))
        error = force_error(log)[full_force_samples(log)]
        metrics.add("max_force_error", peak(np.abs(error)))
        rms = float(np.sqrt(np.mean(error**2))) if error.size else math.nan
        metrics.add("rms_force_error", rms)
    return metrics


def touch_down(log: RunLog) -> float:
    """Return the first time of contact with the workpiece [s]; NaN without contact."""
    touching = np.flatnonzero(log["normal_force"].values[:, 0] > TOUCHING)
    return float(log.time[touching[0]]) if touching.size else math.nan


def full_force_samples(log: RunLog) -> NDArray[np.bool_]:
    """Return the samples with settled full reference force, shape (samples,)."""
    press = log["press"].values[:, 0]
    full = press >= _FULL * press.max()
    begin = log.time[int(np.argmax(full))]
    return np.asarray(full & (log.time >= max(begin, touch_down(log)) + SETTLING))


def force_error(log: RunLog) -> FloatArray:
    """Return the force on the workpiece minus its reference [N], shape (samples,)."""
    return np.asarray((log["normal_force"].values - log["press"].values)[:, 0])


def touch_down_overshoot(log: RunLog) -> float:
    """Return the largest overshoot relative to the current reference, until it has settled.

    NaN without contact.
    """
    press, settled = log["press"].values[:, 0], full_force_samples(log)
    if math.isnan(touch_down(log)):
        return math.nan
    until = log.time[int(np.argmax(settled))] if settled.any() else math.inf
    counted = (log.time >= touch_down(log)) & (log.time < until) & (press >= _SMALL * press.max())
    return max(0.0, peak((force_error(log) / np.where(counted, press, 1.0))[counted]))


def contact_losses(log: RunLog) -> float:
    """Return the number of contact losses while the reference force is positive."""
    desired = (log.time >= touch_down(log)) & (log["press"].values[:, 0] > TOUCHING)
    off = (log["normal_force"].values[:, 0] <= 0.0)[desired]
    return float(np.count_nonzero(np.diff(off.astype(int)) > 0))


def draw_pressing(log: RunLog) -> style.Drawing:
    """Draw the normal force with reference and error, and the transversal coordinate."""
    time, force = log.time, log["normal_force"].values[:, 0]
    is_pressed = "press" in log
    canvas, panels = style.make_panels(3 if is_pressed else 2, height=2.4)
    upper, lower = panels[0], panels[-1]
    if is_pressed:
        press = log["press"].values[:, 0]
        upper.plot(time, press, label="reference", **style.BROAD)
        _draw_error(panels[1], log)
    upper.plot(time, force, color="C0", label="actual")
    upper.set(ylabel="force in N", title="Force along the workpiece's normal")
    lower.axhline(0.0, color=style.REFERENCE, linewidth=0.8, label="taught surface")
    lower.plot(time, 1e3 * log["xi"].values[:, 0], color="C0", label="tool point")
    lower.set(ylabel=r"$\xi$ in mm", title="Distance from the taught surface")
    for panel in panels:
        if panel.get_legend_handles_labels()[1]:
            style.add_legend(panel)
    caption = (
        "Normal force of the workpiece on the tool, and distance of the tool point from the taught "
        "surface"
    )
    caption += f"; the band is {BAND:g} N to either side of the full force." if is_pressed else "."
    return style.Drawing("pressing", "Force on the workpiece", caption, canvas)


def draw_force_map(log: RunLog) -> style.Drawing:
    """Draw the normal force over the workpiece, along the tool's path."""
    force = log["normal_force"].values[:, 0]
    on = force > TOUCHING
    along, across = 1e3 * log["eta"].values[on].T
    canvas = style.make_canvas(*_SIZE)
    panel = canvas.subplots()
    dots = panel.scatter(along, across, c=force[on], s=_DOT, cmap="viridis", linewidths=0.0)
    if "press" in log:
        full = float(log["press"].values.max())
        dots.set_clim(full - BAND, full + BAND)
    canvas.colorbar(dots, ax=panel, label="force in N", extend="both")
    panel.set(xlabel=r"$\eta_1$ in mm", ylabel=r"$\eta_2$ in mm", aspect="equal")
    panel.set_title("Force along the normal over the workpiece")
    caption = "Force on the workpiece along the tool's path, over the tangential coordinates."
    return style.Drawing("force_map", "Force over the workpiece", caption, canvas)


def _draw_error(panel: "Axes", log: RunLog) -> None:
    """Draw the force error at settled full reference, with its band."""
    settled = full_force_samples(log)
    error = np.where(settled, force_error(log), np.nan)
    panel.axhspan(-BAND, BAND, color=style.REFERENCE, alpha=0.15, linewidth=0.0)
    panel.axhline(0.0, color=style.REFERENCE, linewidth=0.8)
    panel.plot(log.time, error, color="C0")
    span = max(1.2 * BAND, 1.1 * float(np.nanmax(np.abs(error), initial=0.0)))
    panel.set(ylim=(-span, span), ylabel="error in N", title="Force error after touch-down")


FEATURE = Feature(
    signals=add_pressing,
    metrics=lambda log, station, settings: press_metrics(log),
    figures={"pressing": draw_pressing, "force_map": draw_force_map},
)
