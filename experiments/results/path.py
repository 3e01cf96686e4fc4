"""Metrics of a path following run, each a pure function of its log.

Signals used, as in the log: ``xi`` [samples, 2] m, of a surface [samples, 1], ``eta``, ``eta_p``
[samples, 1] m, of a surface [samples, 2], ``eta_dot`` m/s, ``phi`` [samples, 3] rad, or
[samples, 2] of an axis, ``tau_d`` [samples, axes] with attribute ``limits``, ``saturated_drives``
and ``fault`` [samples, 1], ``manifold_force`` [samples, 3 or more], the first three in N along
the translational coordinates, ``tared`` [samples, 1] 0 or 1, ``wrench_ext`` [samples, 6] N and
Nm, ``notch_position`` [samples, 2] m. Times are those of the log's time axis. A metric over an
interval that holds no sample is NaN.
"""

import math
from collections.abc import Collection

import numpy as np

from experiments.results.drives import peak_torque, saturation_count
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.geometry import ShapeReport
from pfsc_drake.geometry.surfaces.report import SurfaceReport
from pfsc_drake.geometry.surfaces.residuals import Residuals
from reporting.metrics import Metrics


def path_distance(log: RunLog) -> FloatArray:
    """Transversal distance from the path, sqrt(xi_1^2 + xi_2^2).

    Args:
        log: With ``xi``.

    Returns:
        [samples] m.
    """
    return np.asarray(np.linalg.norm(log["xi"].values, axis=1))


def settling_time(log: RunLog, tolerance: float) -> float:
    """First sample time from which on the distance from the path stays at or below a tolerance.

    Args:
        log: With ``xi``.
        tolerance: m.

    Returns:
        s; NaN if the last sample is still outside (NaN in the signal counts as outside).
    """
    outside = np.flatnonzero(~(path_distance(log) <= tolerance))
    first_inside = 0 if outside.size == 0 else int(outside[-1]) + 1
    return float(log.time[first_inside]) if first_inside < log.time.size else math.nan


def max_path_deviation_after(log: RunLog, t: float) -> float:
    """Largest distance from the path at times >= t.

    Args:
        log: With ``xi``.
        t: s.

    Returns:
        m.
    """
    return _max(path_distance(log)[log.time >= t])


def max_path_deviation_while_moving(log: RunLog, min_speed: float, t: float = -math.inf) -> float:
    """Largest distance from the path while abs(eta') >= min_speed, at times >= t.

    Args:
        log: With ``xi`` and ``eta_dot``.
        min_speed: m/s.
        t: s, to leave out the transient from the start pose.

    Returns:
        m.
    """
    moving = np.linalg.norm(log["eta_dot"].values, axis=1) >= min_speed
    return _max(path_distance(log)[moving & (log.time >= t)])


def rms_path_deviation(log: RunLog, t: float = -math.inf) -> float:
    """Root mean square of the distance from the path over the samples at times >= t.

    Args:
        log: With ``xi``.
        t: s.

    Returns:
        m.
    """
    distance = path_distance(log)[log.time >= t]
    return float(np.sqrt(np.mean(distance**2))) if distance.size else math.nan


def static_path_deviation(log: RunLog, window: float = 0.2) -> float:
    """Mean distance from the path over the end of the run.

    Args:
        log: With ``xi``.
        window: s, length of the interval before the last sample.

    Returns:
        m.
    """
    return float(np.mean(path_distance(log)[log.time >= log.time[-1] - window]))


def max_orientation_error_after(log: RunLog, t: float) -> float:
    """Largest norm of the orientation error phi at times >= t.

    Args:
        log: With ``phi``.
        t: s.

    Returns:
        rad.
    """
    return _max(np.linalg.norm(log["phi"].values, axis=1)[log.time >= t])


def peak_speed(log: RunLog) -> float:
    """Largest speed along the path, max abs(eta'), or on the surface, max |eta'|.

    Args:
        log: With ``eta_dot``.

    Returns:
        m/s.
    """
    return _max(np.linalg.norm(log["eta_dot"].values, axis=1))


def tangential_error(log: RunLog, t: float = -math.inf) -> float:
    """Largest tangential error, max |eta - eta_p| at times >= t.

    Args:
        log: With ``eta`` and ``eta_p``.
        t: s.

    Returns:
        m.
    """
    error = np.linalg.norm(log["eta"].values - log["eta_p"].values, axis=1)
    return _max(error[log.time >= t])


def max_manifold_force(log: RunLog) -> float:
    """Largest force along the path's coordinates, the size of its three translational parts.

    Args:
        log: With ``manifold_force``; with ``tared`` only samples with a tared sensor count.

    Returns:
        N.
    """
    return _max(np.linalg.norm(_tared_forces(log), axis=1))


def max_tangential_force(log: RunLog) -> float:
    """Largest magnitude of the force along the path, or along the surface.

    Args:
        log: With ``manifold_force`` and ``eta``; with ``tared`` only samples with a tared sensor
            count.

    Returns:
        N.
    """
    along = log["eta"].dim if "eta" in log else 1
    return _max(np.linalg.norm(_tared_forces(log)[:, :along], axis=1))


def max_external_force(log: RunLog) -> float:
    """Largest size of the force that acts on the tool, whether measured or not.

    Args:
        log: With ``wrench_ext``.

    Returns:
        N.
    """
    return _max(np.linalg.norm(log["wrench_ext"].values[:, :3], axis=1))


def max_distance_from_notch_axis(log: RunLog) -> float:
    """Largest distance of a ball from the middle of its notch.

    Args:
        log: With ``notch_position``.

    Returns:
        m.
    """
    return _max(np.linalg.norm(log["notch_position"].values, axis=1))


def path_following_metrics(
    log: RunLog, settling_tolerance: float, converged_after: float, min_speed: float
) -> Metrics:
    """All metrics of this module that the log has signals for.

    Args:
        log: Of a path following run.
        settling_tolerance: m, see :func:`settling_time`.
        converged_after: s, from when on deviations count.
        min_speed: m/s, from which on the tool counts as moving.

    Returns:
        The metrics, in SI units.
    """
    metrics = Metrics()
    if "xi" in log:
        metrics.add("settling_time", settling_time(log, settling_tolerance), "s")
        deviation = max_path_deviation_after(log, converged_after)
        metrics.add("max_path_deviation", deviation, "m")
        if "eta_dot" in log:
            moving = max_path_deviation_while_moving(log, min_speed, converged_after)
            metrics.add("max_path_deviation_while_moving", moving, "m")
        metrics.add("rms_path_deviation", rms_path_deviation(log, converged_after), "m")
        metrics.add("static_path_deviation", static_path_deviation(log), "m")
    if "xi_d" in log:
        off = np.linalg.norm(log["xi"].values - log["xi_p"].values, axis=1)
        largest = _max(off[log.time >= converged_after])
        # what rests because its sensor was never tared does not yield
        if "tared" in log and not log["tared"].values.any():
            largest = math.nan
        metrics.add("max_error_from_compliant_reference", largest, "m")
    if "xi_M" in log:
        distance = np.linalg.norm(log["xi_M"].values, axis=1)[log.time >= converged_after]
        metrics.add("max_path_deviation_of_motors", _max(distance), "m")
    if "phi" in log:
        error = max_orientation_error_after(log, converged_after)
        metrics.add("max_orientation_error", error, "rad")
    if "eta" in log:
        # what a hand leads freely has no reference
        error = tangential_error(log) if "eta_p" in log else math.nan
        metrics.add("max_tangential_error", error, "m")
    if "eta_dot" in log:
        metrics.add("peak_speed", peak_speed(log), "m/s")
    if "tau_d" in log:
        for axis, torque in enumerate(peak_torque(log), start=1):
            metrics.add(f"peak_torque_{axis}", float(torque), log["tau_d"].unit)
        saturated = saturation_count(log)
        metrics.add("saturated_samples", saturated, "1")
        metrics.add("saturated_share", saturated / max(log.time.size, 1), "1")
    if "manifold_force" in log:
        metrics.add("max_manifold_force", max_manifold_force(log), "N")
        metrics.add("max_tangential_force", max_tangential_force(log), "N")
    if "wrench_ext" in log:
        metrics.add("max_external_force", max_external_force(log), "N")
    if "wrench_ext" in log and "tared" in log:
        metrics.add("max_unanswered_force", max_unanswered_force(log), "N")
    if "notch_position" in log:
        farthest = max_distance_from_notch_axis(log)
        metrics.add("max_distance_from_notch_axis", farthest, "m")
    return metrics


def metric_names(num_joints: int, signals: Collection[str]) -> list[str]:
    """Return the names of the metrics that :func:`path_following_metrics` gives.

    Args:
        num_joints: Number of drives.
        signals: Of ``phi``, ``xi_M``, ``xi_d``, ``manifold_force``, ``wrench_ext`` and
            ``notch_position`` those that the log has, among others.
    """
    optional = {
        "xi_d": ["max_error_from_compliant_reference"],
        "xi_M": ["max_path_deviation_of_motors"],
        "phi": ["max_orientation_error"],
        "manifold_force": ["max_manifold_force", "max_tangential_force"],
        "wrench_ext": ["max_external_force"],
        "notch_position": ["max_distance_from_notch_axis"],
    }
    given = {key: names if key in signals else [] for key, names in optional.items()}
    return [
        "settling_time",
        "max_path_deviation",
        "max_path_deviation_while_moving",
        "rms_path_deviation",
        "static_path_deviation",
        *given["xi_d"],
        *given["xi_M"],
        *given["phi"],
        "max_tangential_error",
        "peak_speed",
        *(f"peak_torque_{axis}" for axis in range(1, num_joints + 1)),
        "saturated_samples",
        "saturated_share",
        *given["manifold_force"],
        *given["wrench_ext"],
        *(["max_unanswered_force"] if {"wrench_ext", "tared"} <= set(signals) else []),
        *given["notch_position"],
    ]


def max_unanswered_force(log: RunLog) -> float:
    """Largest force on the tool while what yields waits for a sensor that is not tared.

    Args:
        log: With ``wrench_ext`` and ``tared``; with ``held`` only samples without a plate, whose
            weight is known.

    Returns:
        N; zero if it was tared all the time.
    """
    waiting = log["tared"].values[:, 0] == 0.0
    if "held" in log:
        waiting &= log["held"].values[:, 0] == 0.0
    forces = np.linalg.norm(log["wrench_ext"].values[waiting, :3], axis=1)
    return float(forces.max(initial=0.0))


def _tared_forces(log: RunLog) -> FloatArray:
    """Forces along (eta, xi_1, xi_2) [N] at the samples with a tared sensor."""
    forces = log["manifold_force"].values[:, :3]
    return forces[log["tared"].values[:, 0] != 0.0] if "tared" in log else forces


def _max(values: FloatArray) -> float:
    """Largest value, NaN of none."""
    return float(np.max(values)) if values.size else math.nan


def shape_metrics(
    shape: ShapeReport | SurfaceReport | None, fit: Residuals | None = None
) -> Metrics:
    """Return the numbers of a path's or a surface's shape that exist, in SI units.

    Args:
        shape: From :func:`shape_report` or :func:`surface_report`.
        fit: Where the points stand that a surface was fitted to, if it was.
    """
    metrics = Metrics()
    if isinstance(shape, SurfaceReport):
        metrics.add("surface_area", shape.area, "m^2")
        for side in ("outside", "inside"):
            radius = getattr(shape, f"radius_{side}")
            if math.isfinite(radius):
                metrics.add(f"surface_smallest_radius_{side}", radius, "m")
        if fit is not None:
            metrics.add("surface_fit_rms", fit.rms, "m")
            metrics.add("surface_fit_max", fit.largest, "m")
        return metrics
    if shape is None:
        return metrics
    metrics.add("path_length", shape.length, "m")
    if math.isfinite(shape.smallest_radius):
        metrics.add("path_smallest_radius", shape.smallest_radius, "m")
        metrics.add("path_smallest_radius_at", shape.smallest_radius_at, "m")
    if shape.distance_from_points is not None:
        metrics.add("path_distance_from_points", shape.distance_from_points, "m")
    if shape.distance_from_polygon is not None:
        metrics.add("path_distance_from_polygon", shape.distance_from_polygon, "m")
    if shape.largest_angle_rate is not None:
        metrics.add("path_angle_rate", shape.largest_angle_rate, "rad/m")
    return metrics
