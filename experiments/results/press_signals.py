"""Signals of a tool that presses on a workpiece."""

import numpy as np

from diagrams.station import Station
from experiments.results.run_log import RunLog


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
