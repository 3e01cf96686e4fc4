"""Metrics of a tool that presses on a workpiece, each a pure function of a run's log.

Signals used, as in the log: ``normal_force`` [samples, 1] N, with which the workpiece presses
along its normal, and ``press`` [samples, 1] N, what it is to be.
"""

import math
from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from diagrams.station import Station
from experiments.results.run_log import FloatArray, RunLog
from reporting.metrics import Metrics

TOUCHING = 0.5  # N, from which on the tool counts as on the workpiece
SETTLING = 0.2  # s, from touch-down and full force on, until the force shall keep
_FULL = 0.999  # of the largest reference, from which on it counts as full
_SMALL = 0.1  # of the same; below it there is nothing to overshoot


def touch_down(log: RunLog) -> float:
    """First time at which the tool is on the workpiece.

    Args:
        log: With ``normal_force``.

    Returns:
        s; NaN if it never is.
    """
    touching = np.flatnonzero(log["normal_force"].values[:, 0] > TOUCHING)
    return float(log.time[touching[0]]) if touching.size else math.nan


def held_samples(log: RunLog) -> NDArray[np.bool_]:
    """Which samples are of the time in which the full force shall keep, [samples] bool.

    Args:
        log: With ``normal_force`` and ``press``.
    """
    press = log["press"].values[:, 0]
    full = press >= _FULL * press.max()
    begin = log.time[int(np.argmax(full))]
    return np.asarray(full & (log.time >= max(begin, touch_down(log)) + SETTLING))


def force_error(log: RunLog) -> FloatArray:
    """Force on the workpiece less its reference, [samples] N.

    Args:
        log: With ``normal_force`` and ``press``.
    """
    return np.asarray((log["normal_force"].values - log["press"].values)[:, 0])


def touch_down_overshoot(log: RunLog) -> float:
    """Largest force above the reference of the moment, in units of it, until it shall keep.

    Args:
        log: With ``normal_force`` and ``press``.

    Returns:
        1; NaN if the tool never touches.
    """
    press, held = log["press"].values[:, 0], held_samples(log)
    if math.isnan(touch_down(log)):
        return math.nan
    until = log.time[int(np.argmax(held))] if held.any() else math.inf
    counted = (log.time >= touch_down(log)) & (log.time < until) & (press >= _SMALL * press.max())
    return max(0.0, _max((force_error(log) / np.where(counted, press, 1.0))[counted]))


def contact_losses(log: RunLog) -> float:
    """How often the tool leaves the workpiece while it is to press.

    Args:
        log: With ``normal_force`` and ``press``.
    """
    wanted = (log.time >= touch_down(log)) & (log["press"].values[:, 0] > TOUCHING)
    off = (log["normal_force"].values[:, 0] <= 0.0)[wanted]
    return float(np.count_nonzero(np.diff(off.astype(int)) > 0))


def press_metrics(log: RunLog) -> Metrics:
    """All metrics of this module that the log has signals for.

    Args:
        log: Of a path following run.
    """
    metrics = Metrics()
    if "normal_force" not in log or log.time.size == 0:
        return metrics
    metrics.add("peak_force", _max(log["normal_force"].values), "N")
    if "press" in log:
        metrics.add("touch_down", touch_down(log), "s")
        metrics.add("touch_down_overshoot", touch_down_overshoot(log), "1")
        metrics.add("contact_losses", contact_losses(log), "1")
        error = force_error(log)[held_samples(log)]
        metrics.add("max_force_error", _max(np.abs(error)), "N")
        rms = float(np.sqrt(np.mean(error**2))) if error.size else math.nan
        metrics.add("rms_force_error", rms, "N")
    return metrics


def press_metric_names(signals: Collection[str]) -> list[str]:
    """Return the names of the metrics that :func:`press_metrics` gives.

    Args:
        signals: Those that the log has.
    """
    if "normal_force" not in signals:
        return []
    pressed = ["touch_down", "touch_down_overshoot", "contact_losses"]
    pressed += ["max_force_error", "rms_force_error"]
    return ["peak_force", *(pressed if "press" in signals else [])]


def _max(values: FloatArray) -> float:
    """Largest value, NaN of none."""
    return float(np.max(values)) if values.size else math.nan


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
        log.add("press", raw["press"], "N", ["press"])
    workpiece, axes = station.workpiece, station.task.place.axes
    if workpiece is None or not is_pressed(station):
        return
    normals = np.array([workpiece.normal(axes(point).full()) for point in points]).reshape(-1, 3)
    force = np.sum(raw["wrench_ext"][:, :3] * normals, axis=1, keepdims=True)
    log.add("normal_force", force, "N", ["f_n"])


def is_pressed(station: Station) -> bool:
    """Return whether a station's workpiece has a normal to press along.

    Args:
        station: The station, simulated or not.
    """
    workpiece = station.workpiece
    return workpiece is not None and workpiece.normal(np.eye(3)) is not None
