"""Metrics of following a path or a surface, of its shape, and of pressing on it, from a log.

Signals used, as in the log: ``xi`` [samples, 2] m, of a surface [samples, 1], ``eta``, ``eta_p``
[samples, 1] m, of a surface [samples, 2], ``eta_dot`` m/s, ``phi`` [samples, 3] rad, or
[samples, 2] of an axis, ``tau_d`` [samples, axes] with attribute ``limits``, ``saturated_drives``
and ``fault`` [samples, 1], ``manifold_force`` [samples, 3 or more], the first three in N along
the translational coordinates, ``tared`` [samples, 1] 0 or 1, ``wrench_ext`` [samples, 6] N and
Nm, ``notch_position`` [samples, 2] m, ``normal_force`` and ``press`` [samples, 1] N. Times are
those of the log's time axis. A metric over an interval that holds no sample is NaN.
"""

import math

import numpy as np
from numpy.typing import NDArray

from diagrams.station import Station
from experiments.results.drives import limit_reversals, peak_torque, saturation_count
from experiments.results.run_log import FloatArray, RunLog, peak
from pfsc_drake.geometry import ShapeReport
from pfsc_drake.geometry.surfaces.penalized_surface import Residuals
from pfsc_drake.geometry.surfaces.regularity import SurfaceReport
from reporting.metrics import Metrics


def path_following_metrics(
    log: RunLog, settling_tolerance: float, converged_after: float, min_speed: float
) -> Metrics:
    """Return the metrics of following that the log has signals for.

    Args:
        log: Log of a run.
        settling_tolerance: Distance from the path that counts as converged [m].
        converged_after: Time from which on deviations count [s].
        min_speed: Speed from which on the tool counts as moving [m/s].
    """
    metrics = Metrics()
    if "xi" in log:
        metrics.add("settling_time", settling_time(log, settling_tolerance))
        metrics.add("max_path_deviation", max_path_deviation_after(log, converged_after))
        if "eta_dot" in log:
            moving = max_path_deviation_while_moving(log, min_speed, converged_after)
            metrics.add("max_path_deviation_while_moving", moving)
        metrics.add("rms_path_deviation", rms_path_deviation(log, converged_after))
        metrics.add("static_path_deviation", static_path_deviation(log))
    if "xi_d" in log:
        off = np.linalg.norm(log["xi"].values - log["xi_p"].values, axis=1)
        largest = peak(off[log.time >= converged_after])
        # what rests because its sensor was never tared does not yield
        if "tared" in log and not log["tared"].values.any():
            largest = math.nan
        metrics.add("max_error_from_compliant_reference", largest)
    if "xi_M" in log:
        of_motors = _sizes(log, "xi_M")[log.time >= converged_after]
        metrics.add("max_path_deviation_of_motors", peak(of_motors))
    if "phi" in log:
        metrics.add("max_orientation_error", max_orientation_error_after(log, converged_after))
    if "eta" in log:
        # what a hand leads freely has no reference
        error = tangential_error(log) if "eta_p" in log else math.nan
        metrics.add("max_tangential_error", error)
    if "eta_dot" in log:
        metrics.add("peak_speed", peak_speed(log))
    if "tau_d" in log:
        for axis, torque in enumerate(peak_torque(log), start=1):
            metrics.add(f"peak_torque_{axis}", float(torque), log["tau_d"].unit)
        saturated = saturation_count(log)
        metrics.add("saturated_samples", saturated)
        metrics.add("saturated_share", saturated / max(log.time.size, 1))
        if log["tau_d"].limits is not None and "fault" in log:
            metrics.add("limit_reversals", limit_reversals(log))
    if "manifold_force" in log:
        metrics.add("max_manifold_force", max_manifold_force(log))
        metrics.add("max_tangential_force", max_tangential_force(log))
    if "wrench_ext" in log:
        metrics.add("max_external_force", max_external_force(log))
    if "wrench_ext" in log and "tared" in log:
        metrics.add("max_unanswered_force", max_unanswered_force(log))
    if "notch_position" in log:
        metrics.add("max_distance_from_notch_axis", max_distance_from_notch_axis(log))
    return metrics


def path_distance(log: RunLog) -> FloatArray:
    """Return the distance from the path, |xi| [m], shape (samples,)."""
    return _sizes(log, "xi")


def settling_time(log: RunLog, tolerance: float) -> float:
    """Return the time from which on |xi| stays at or below a tolerance [m], in s.

    NaN if the last sample is still outside (NaN in the signal counts as outside).
    """
    outside = np.flatnonzero(~(path_distance(log) <= tolerance))
    first_inside = 0 if outside.size == 0 else int(outside[-1]) + 1
    return float(log.time[first_inside]) if first_inside < log.time.size else math.nan


def max_path_deviation_after(log: RunLog, t: float) -> float:
    """Return the largest |xi| at times >= t [s], in m."""
    return peak(path_distance(log)[log.time >= t])


def max_path_deviation_while_moving(log: RunLog, min_speed: float, t: float = -math.inf) -> float:
    """Return the largest |xi| [m] while |eta'| >= min_speed [m/s], at times >= t [s]."""
    moving = _sizes(log, "eta_dot") >= min_speed
    return peak(path_distance(log)[moving & (log.time >= t)])


def rms_path_deviation(log: RunLog, t: float = -math.inf) -> float:
    """Return the root mean square of |xi| over the samples at times >= t [s], in m."""
    distance = path_distance(log)[log.time >= t]
    return float(np.sqrt(np.mean(distance**2))) if distance.size else math.nan


def static_path_deviation(log: RunLog, window: float = 0.2) -> float:
    """Return the mean of |xi| [m] over a window [s] before the last sample."""
    return float(np.mean(path_distance(log)[log.time >= log.time[-1] - window]))


def max_orientation_error_after(log: RunLog, t: float) -> float:
    """Return the largest |phi| at times >= t [s], in rad."""
    return peak(_sizes(log, "phi")[log.time >= t])


def peak_speed(log: RunLog) -> float:
    """Return the largest speed along the path or on the surface, |eta'| [m/s]."""
    return peak(_sizes(log, "eta_dot"))


def tangential_error(log: RunLog, t: float = -math.inf) -> float:
    """Return the largest |eta - eta_p| at times >= t [s], in m."""
    error = np.linalg.norm(log["eta"].values - log["eta_p"].values, axis=1)
    return peak(error[log.time >= t])


def max_manifold_force(log: RunLog) -> float:
    """Return the largest force [N] along the translational coordinates, with a tared sensor."""
    return peak(np.linalg.norm(_tared_forces(log), axis=1))


def max_tangential_force(log: RunLog) -> float:
    """Return the largest force [N] along the path or the surface, with a tared sensor."""
    along = log["eta"].dim if "eta" in log else 1
    return peak(np.linalg.norm(_tared_forces(log)[:, :along], axis=1))


def max_external_force(log: RunLog) -> float:
    """Return the largest force on the tool [N], whether measured or not."""
    return peak(np.linalg.norm(log["wrench_ext"].values[:, :3], axis=1))


def max_distance_from_notch_axis(log: RunLog) -> float:
    """Return the largest distance of a ball from the middle of its notch [m]."""
    return peak(_sizes(log, "notch_position"))


def max_unanswered_force(log: RunLog) -> float:
    """Return the largest force on the tool [N] while the sensor is not tared, zero without.

    With ``held`` only samples without a plate count, whose weight is known.
    """
    waiting = log["tared"].values[:, 0] == 0.0
    if "held" in log:
        waiting &= log["held"].values[:, 0] == 0.0
    forces = np.linalg.norm(log["wrench_ext"].values[waiting, :3], axis=1)
    return float(forces.max(initial=0.0))


def shape_metrics(
    shape: ShapeReport | SurfaceReport | None, fit: Residuals | None = None
) -> Metrics:
    """Return the numbers of a path's or a surface's shape that exist.

    Args:
        shape: From :func:`shape_report` or :func:`surface_report`.
        fit: Where the points stand that a surface was fitted to, if it was.
    """
    metrics = Metrics()
    if isinstance(shape, SurfaceReport):
        metrics.add("surface_area", shape.area)
        if math.isfinite(shape.radius_outside):
            metrics.add("surface_smallest_radius_outside", shape.radius_outside)
        if math.isfinite(shape.radius_inside):
            metrics.add("surface_smallest_radius_inside", shape.radius_inside)
        if fit is not None:
            metrics.add("surface_fit_rms", fit.rms)
            metrics.add("surface_fit_max", fit.largest)
        return metrics
    if shape is None:
        return metrics
    metrics.add("path_length", shape.length)
    if math.isfinite(shape.smallest_radius):
        metrics.add("path_smallest_radius", shape.smallest_radius)
        metrics.add("path_smallest_radius_at", shape.smallest_radius_at)
    if shape.distance_from_points is not None:
        metrics.add("path_distance_from_points", shape.distance_from_points)
    if shape.distance_from_polygon is not None:
        metrics.add("path_distance_from_polygon", shape.distance_from_polygon)
    if shape.largest_angle_rate is not None:
        metrics.add("path_angle_rate", shape.largest_angle_rate)
    return metrics


def _tared_forces(log: RunLog) -> FloatArray:
    """Return the forces along (eta, xi) [N] at the samples with a tared sensor."""
    forces = log["manifold_force"].values[:, :3]
    return forces[log["tared"].values[:, 0] != 0.0] if "tared" in log else forces


def _sizes(log: RunLog, name: str) -> FloatArray:
    """Return the norm of a signal at each sample."""
    return np.asarray(np.linalg.norm(log[name].values, axis=1))


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
        points: Points of the manifold, next to the tool, shape (samples, size).
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
