"""The taught path, the one that fits it, and the one that was followed, in numbers."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from experiments.results.run_log import FloatArray, RunLog
from experiments.teaching.taught import DWELL, Taught, seen_tool, true_tool
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    Path,
    ShapeReport,
    path_from_waypoints,
    quaternion_to_matrix,
    shape_report,
)
from reporting.metrics import Metrics

_LINE_STEP = 2e-4  # m, between the samples of a path


@dataclass(frozen=True)
class Fit:
    """How a path fits waypoints.

    Attributes:
        eta: Arc length of each waypoint's foot [m], shape (n,).
        distances: Distances of the waypoints from the path [m], shape (n,).
        turns: Angle between their orientations and the path's [rad], shape (n,); zero without.
        motion: Distance of everything that was seen between the first and the last waypoint from
            the path [m], shape (samples,).
        shape: Shape of the path.
        through: The path through all waypoints, None if there is no such path.
        shape_through: Its shape.
    """

    eta: FloatArray
    distances: FloatArray
    turns: FloatArray
    motion: FloatArray
    shape: ShapeReport
    through: Path | None
    shape_through: ShapeReport | None


@dataclass(frozen=True)
class FollowedShape:
    """How a taught path was followed, from when the tool had come to it.

    Attributes:
        eta: Where the tool was [m], shape (samples,).
        seen: Distance from the path as the controller saw it [m], shape (samples,).
        true: Distance of the tool from the path [m], shape (samples,).
        repeated: Distance of the tool from where it was while it was taught [m], (samples,).
        turns: Angle from how it was turned there [rad], shape (samples,).
        error: How far the tool was from where the controller took it to be [m], (samples,).
        error_change: By how much that is not the error at the same place while it was taught [m],
            shape (samples,).
        y_t: Where the tool was [m], shape (samples, 3).
    """

    eta: FloatArray
    seen: FloatArray
    true: FloatArray
    repeated: FloatArray
    turns: FloatArray
    error: FloatArray
    error_change: FloatArray
    y_t: FloatArray


def line_of(path: Path) -> FloatArray:
    """Return a path as a line of samples [m], shape (k, 3)."""
    begin, end = path.position.domain
    count = max(int(np.ceil(path.length / _LINE_STEP)), 2)
    line: FloatArray = path.position.derivatives(np.linspace(begin, end, count + 1), 0)[:, 0]
    return line


def compare_fit(taught: Taught) -> Fit:
    """Compare the path with the waypoints it was fitted to."""
    path, table = taught.path, taught.table
    assert path.waypoints is not None
    theta = path.waypoints.parameters
    feet = path.position.derivatives(theta, 0)[:, 0]
    turns = np.zeros(len(theta))
    if table.quaternions is not None and path.orientation is not None:
        wanted = quaternion_to_matrix(path.orientation.derivatives(theta, 0)[:, 0])
        turns = _angles(quaternion_to_matrix(table.quaternions), wanted)
    between = slice(int(taught.rows[0]), int(taught.rows[-1]) + 1)
    motion = seen_tool(taught.log)[0][between]
    motion = motion[np.isfinite(motion).all(axis=1)]
    try:
        closed, smoothness = path.closed, taught.smoothness
        through = path_from_waypoints(table, smoothness=smoothness, closed=closed)
    except InputError:
        through = None
    return Fit(
        np.asarray(path.arc_length(theta)),
        np.linalg.norm(feet - table.positions, axis=1),
        turns,
        nearest_on_line(motion, line_of(path)).distances,
        shape_report(path),
        through,
        None if through is None else shape_report(through),
    )


def compare_followed(taught: Taught, log: RunLog) -> FollowedShape:
    """Compare the run along the path with the one in which it was taught.

    Args:
        taught: The path.
        log: Log of the run along it.
    """
    y_taught, R_taught, error_taught = _led_tool(taught)
    y_t, R_e = true_tool(log)
    seen, _ = seen_tool(log)
    xi = log["xi_measured" if "xi_measured" in log else "xi"].values
    rows = (log.time >= DWELL) & np.isfinite(np.hstack([y_t, seen, xi])).all(axis=1)
    y_t, R_e, seen, xi = y_t[rows], R_e[rows], seen[rows], xi[rows]
    nearest = nearest_on_line(y_t, y_taught)
    error = y_t - seen
    change = np.linalg.norm(error - nearest.at(error_taught), axis=1)
    return FollowedShape(
        log["eta"].values[rows, 0],
        np.linalg.norm(xi, axis=1),
        np.linalg.norm(log["xi"].values[rows], axis=1),
        nearest.distances,
        _angles(R_e, R_taught[nearest.samples]),
        np.linalg.norm(error, axis=1),
        change,
        y_t,
    )


def _led_tool(taught: Taught) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return where the tool was between first and last waypoint, how turned, and how far off.

    From the last waypoint of a closed path it goes straight to the first.
    """
    y_seen, (y_t, R_e) = seen_tool(taught.log)[0], true_tool(taught.log)
    error = y_t - y_seen
    rows = np.arange(int(taught.rows[0]), int(taught.rows[-1]) + 1)
    rows = rows[np.isfinite(error[rows]).all(axis=1)]
    if not taught.path.closed:
        return y_t[rows], R_e[rows], error[rows]
    first, last = rows[0], rows[-1]
    count = int(np.ceil(np.linalg.norm(y_t[first] - y_t[last]) / _LINE_STEP))
    share = (np.arange(1, count + 1) / count)[:, None] if count else np.zeros((0, 1))
    nearer = np.where(share[:, 0] < 0.5, last, first)
    closing = [x[last] + share * (x[first] - x[last]) for x in (y_t, error)]
    return (
        np.vstack([y_t[rows], closing[0]]),
        np.concatenate([R_e[rows], R_e[nearer]]),
        np.vstack([error[rows], closing[1]]),
    )


def _angles(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the angles between rotations (n, 3, 3), shape (n,) [rad]."""
    if len(one) == 0:
        return np.zeros(0)
    turns = Rotation.from_matrix(one) * Rotation.from_matrix(other).inv()
    return np.asarray(turns.magnitude())


def comparison_metrics(
    taught: Taught, fit: Fit, velocity: float, followed: FollowedShape | None
) -> Metrics:
    """Return the numbers of a page.

    Args:
        taught: The path.
        fit: From :func:`compare_fit`.
        velocity: Along the path [m/s].
        followed: From :func:`compare_followed`; None if it was not followed.
    """
    metrics = Metrics()
    metrics.add("waypoints", len(taught.rows), "1")
    metrics.add("path_length", taught.path.length, "m")
    metrics.add("fit_distance_max", fit.distances.max(), "m", source="waypoints from the path")
    metrics.add("fit_distance_rms", _rms(fit.distances), "m", source="the same")
    metrics.add(
        "fit_distance_of_motion", fit.motion.max(), "m", source="all samples between the waypoints"
    )
    if taught.table.quaternions is not None:
        metrics.add("fit_turn_max", fit.turns.max(), "rad", source="waypoints from the path")
    _add_shape(metrics, fit, velocity)
    if followed is None or followed.eta.size == 0:
        return metrics
    metrics.add("follow_deviation_seen", followed.seen.max(), "m", source="xi as measured")
    metrics.add("follow_deviation_true", followed.true.max(), "m", source="xi of the tool itself")
    source = "tool itself, from where it was while it was taught"
    metrics.add("follow_from_taught_max", followed.repeated.max(), "m", source=source)
    metrics.add("follow_from_taught_rms", _rms(followed.repeated), "m", source="the same")
    if taught.table.quaternions is not None:
        metrics.add("follow_turn_from_taught", followed.turns.max(), "rad", source="the same")
    source = "tool itself from where the controller takes it to be"
    metrics.add("model_error_of_place", followed.error.max(), "m", source=source)
    source = "by how much that differs between teaching and following"
    metrics.add("model_error_left", followed.error_change.max(), "m", source=source)
    return metrics


def _add_shape(metrics: Metrics, fit: Fit, velocity: float) -> None:
    """Add how sharply a path bends, and how jerky a motion of this velocity along it is."""
    for name, shape in {"through_all": fit.shape_through, "fitted": fit.shape}.items():
        missing = "no path goes through all waypoints" if shape is None else None
        radius, rate = np.nan, np.nan
        if shape is not None:
            radius, rate = shape.smallest_radius, shape.largest_curvature_rate
        metrics.add(f"smallest_radius_{name}", radius, "m", source=missing)
        source = missing or f"change of the curvature times velocity^3, at {velocity:g} m/s"
        metrics.add(f"largest_jerk_{name}", rate * velocity**3, "m/s^3", source=source)


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


@dataclass(frozen=True)
class Nearest:
    """Where on a line of samples points are nearest.

    Attributes:
        distances: From it [m], shape (n,).
        samples: The sample before that place, shape (n,).
        shares: Shares of the way from there to the next sample, shape (n,).
    """

    distances: FloatArray
    samples: np.ndarray
    shares: FloatArray

    def at(self, values: FloatArray) -> FloatArray:
        """Return values at the samples, interpolated there, shape (n, ..)."""
        shares = self.shares.reshape(-1, *[1] * (values.ndim - 1))
        after = np.minimum(self.samples + 1, len(values) - 1)
        return values[self.samples] + shares * (values[after] - values[self.samples])


def nearest_on_line(points: FloatArray, line: FloatArray) -> Nearest:
    """Return where points are nearest to a line of samples.

    It is on one of the two sides that meet in the nearest sample, which it is wherever the sides
    are short beside the line's bends.

    Args:
        points: Finite [m], shape (n, 3).
        line: Finite [m], shape (k, 3), k > 0; neighbours may coincide.
    """
    # the last of each run of samples that coincide
    apart = np.flatnonzero(np.append(np.any(np.diff(line, axis=0), axis=1), True))
    line = line[apart]
    _, corner = cKDTree(line).query(points)
    best = Nearest(np.linalg.norm(points - line[corner], axis=1), corner, np.zeros(len(points)))
    distances, samples, shares = best.distances, best.samples, best.shares
    for shift in (-1, 0):
        side = np.clip(corner + shift, 0, max(len(line) - 2, 0))
        way = line[np.minimum(side + 1, len(line) - 1)] - line[side]
        square = np.sum(way**2, axis=1)
        along = np.sum((points - line[side]) * way, axis=1) / np.where(square, square, 1.0)
        share = np.clip(along, 0.0, 1.0)
        distance = np.linalg.norm(points - line[side] - share[:, None] * way, axis=1)
        closer = distance < distances
        distances = np.where(closer, distance, distances)
        samples, shares = np.where(closer, side, samples), np.where(closer, share, shares)
    return Nearest(distances, apart[samples], shares)
