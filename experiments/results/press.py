"""A tool that presses on a workpiece: its signals and metrics.

Signals used, as in the log: ``normal_force`` [samples, 1] N, with which the workpiece presses
along its normal, and ``press`` [samples, 1] N, what it is to be.
"""

import math

import numpy as np
from numpy.typing import NDArray

from diagrams.station import Station
from experiments.results.run_log import FloatArray, RunLog, peak
from reporting.metrics import Metrics

TOUCHING = 0.5  # N, from which on the tool counts as on the workpiece
SETTLING = 0.2  # s, from touch-down and full force on, until the force shall keep
_FULL = 0.999  # of the largest reference, from which on it counts as full
_SMALL = 0.1  # of the same; below it there is nothing to overshoot


def add_pressing(
    log: RunLog, station: Station, raw: dict[str, np.ndarray], points: np.ndarray
) -> None:
    """Add the force with which a workpiece presses along its normal, and what it is to be.

    Args:
        log: To add to.
        station: The station that was simulated.
        raw: What it logged.
        points: Of the manifold, next to the tool, shape (samples, size).
    """
    if "press" in raw:
        log.add("press", raw["press"])
    workpiece, axes = station.workpiece, station.task.place.axes
    if workpiece is None or workpiece.normal(np.eye(3)) is None:
        return
    normals = np.array([workpiece.normal(axes(point).full()) for point in points]).reshape(-1, 3)
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
        error = force_error(log)[held_samples(log)]
        metrics.add("max_force_error", peak(np.abs(error)))
        rms = float(np.sqrt(np.mean(error**2))) if error.size else math.nan
        metrics.add("rms_force_error", rms)
    return metrics


def touch_down(log: RunLog) -> float:
    """Return the first time at which the tool is on the workpiece [s]; NaN if it never is."""
    touching = np.flatnonzero(log["normal_force"].values[:, 0] > TOUCHING)
    return float(log.time[touching[0]]) if touching.size else math.nan


def held_samples(log: RunLog) -> NDArray[np.bool_]:
    """Return which samples are of the time in which the full force shall keep, (samples,)."""
    press = log["press"].values[:, 0]
    full = press >= _FULL * press.max()
    begin = log.time[int(np.argmax(full))]
    return np.asarray(full & (log.time >= max(begin, touch_down(log)) + SETTLING))


def force_error(log: RunLog) -> FloatArray:
    """Return the force on the workpiece less its reference [N], shape (samples,)."""
    return np.asarray((log["normal_force"].values - log["press"].values)[:, 0])


def touch_down_overshoot(log: RunLog) -> float:
    """Return the largest force above the reference of the moment, by it, until it shall keep.

    NaN if the tool never touches.
    """
    press, held = log["press"].values[:, 0], held_samples(log)
    if math.isnan(touch_down(log)):
        return math.nan
    until = log.time[int(np.argmax(held))] if held.any() else math.inf
    counted = (log.time >= touch_down(log)) & (log.time < until) & (press >= _SMALL * press.max())
    return max(0.0, peak((force_error(log) / np.where(counted, press, 1.0))[counted]))


def contact_losses(log: RunLog) -> float:
    """Return how often the tool leaves the workpiece while it is to press."""
    wanted = (log.time >= touch_down(log)) & (log["press"].values[:, 0] > TOUCHING)
    off = (log["normal_force"].values[:, 0] <= 0.0)[wanted]
    return float(np.count_nonzero(np.diff(off.astype(int)) > 0))
