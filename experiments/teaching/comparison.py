"""Metrics of a taught path: its fit to waypoints, and the run that follows it."""

from contextlib import suppress

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from experiments.results.run_log import FloatArray, RunLog
from experiments.teaching.taught_path import DWELL, Taught, actual_tool, measured_tool
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import Path, path_from_waypoints, quaternion_to_matrix, shape_report
from reporting.metrics import Metrics

_LINE_STEP = 2e-4  # m, between the samples of a path


class Fit:
    """Fit of a path to its waypoints.

    Args:
        taught: The path.

    Attributes:
        eta: Arc length of the closest point of each waypoint [m], shape (n,).
        distances: Distances of the waypoints from the path [m], shape (n,).
        turns: Angle between their orientations and the path's [rad], shape (n,); zero without.
        motion: Distance of all samples between the first and the last waypoint from the path [m],
            shape (samples,).
        through: Path through all waypoints, or None.
    """

    def __init__(self, taught: Taught) -> None:
        path, table = taught.path, taught.table
        assert path.waypoints is not None
        theta = path.waypoints.parameters
        closest = path.position.derivatives(theta, 0)[:, 0]
        self.eta = np.asarray(path.arc_length(theta))
        self.distances = np.linalg.norm(closest - table.positions, axis=1)
        self.turns = np.zeros(len(theta))
        if table.quaternions is not None and path.orientation is not None:
            desired = quaternion_to_matrix(path.orientation.derivatives(theta, 0)[:, 0])
            self.turns = _angles(quaternion_to_matrix(table.quaternions), desired)
        between = slice(int(taught.rows[0]), int(taught.rows[-1]) + 1)
        motion = measured_tool(taught.log)[0][between]
        motion = motion[np.isfinite(motion).all(axis=1)]
        self.motion = NearestOnLine(motion, line_of(path)).distances
        self.through: Path | None = None
        with suppress(InputError):
            self.through = path_from_waypoints(
                table, smoothness=taught.smoothness, closed=path.closed
            )
        self._path, self._is_oriented = path, table.quaternions is not None

    def add_to(self, metrics: Metrics, velocity: float) -> None:
        """Add the metrics of the fit.

        Args:
            metrics: Metrics of the page.
            velocity: Velocity along the path [m/s].
        """
        metrics.add("waypoints", len(self.eta), "1")
        metrics.add("path_length", self._path.length, "m")
        metrics.add("fit_distance_max", self.distances.max(), "m", source="waypoints from the path")
        metrics.add("fit_distance_rms", _rms(self.distances), "m", source="waypoints from the path")
        source = "all samples between the waypoints"
        metrics.add("fit_distance_of_motion", self.motion.max(), "m", source=source)
        if self._is_oriented:
            metrics.add("fit_turn_max", self.turns.max(), "rad", source="waypoints from the path")
        # smallest radius of a path, and jerk of a motion along it with this velocity
        for name, path in {"through_all": self.through, "fitted": self._path}.items():
            missing, radius, rate = "no path goes through all waypoints", np.nan, np.nan
            if path is not None:
                shape, missing = shape_report(path), ""
                radius, rate = shape.smallest_radius, shape.largest_curvature_rate
            metrics.add(f"smallest_radius_{name}", radius, "m", source=missing or None)
            source = missing or f"change of the curvature times velocity^3, at {velocity:g} m/s"
            metrics.add(f"largest_jerk_{name}", rate * velocity**3, "m/s^3", source=source)


class FollowedShape:
    """Comparison of a run along a taught path with the path and with teaching.

    Args:
        taught: The path.
        log: Log of the run along it.

    Attributes:
        eta: Position of the tool along the path [m], shape (samples,).
        measured: Measured distance from the path [m], shape (samples,).
        actual: Actual distance from the path [m], shape (samples,).
        repeated: Distance of the tool from its motion during teaching [m], shape (samples,).
        turns: Angle from its orientation there [rad], shape (samples,).
        error: Distance of the actual from the measured tool point [m], shape (samples,).
        error_change: Change of this error since teaching, at the same point [m], shape (samples,).
        y_t: Actual tool point [m], shape (samples, 3).
    """

    def __init__(self, taught: Taught, log: RunLog) -> None:
        y_taught, R_taught, error_taught = _guided_tool(taught)
        y_t, R_e = actual_tool(log)
        measured, _ = measured_tool(log)
        xi = log["xi_measured" if "xi_measured" in log else "xi"].values
        rows = (log.time >= DWELL) & np.isfinite(np.hstack([y_t, measured, xi])).all(axis=1)
        self.y_t = y_t[rows]
        nearest, error = NearestOnLine(self.y_t, y_taught), self.y_t - measured[rows]
        self.eta = log["eta"].values[rows, 0]
        self.measured = np.linalg.norm(xi[rows], axis=1)
        self.actual = np.linalg.norm(log["xi"].values[rows], axis=1)
        self.repeated = nearest.distances
        self.turns = _angles(R_e[rows], R_taught[nearest.samples])
        self.error = np.linalg.norm(error, axis=1)
        self.error_change = np.linalg.norm(error - nearest.at(error_taught), axis=1)
        self._is_oriented = taught.table.quaternions is not None

    def add_to(self, metrics: Metrics) -> None:
        """Add the metrics of the run.

        Args:
            metrics: Metrics of the page.
        """
        metrics.add("follow_deviation_seen", self.measured.max(), "m", source="measured xi")
        metrics.add("follow_deviation_true", self.actual.max(), "m", source="actual xi")
        source = "actual tool, from its position during teaching"
        metrics.add("follow_from_taught_max", self.repeated.max(), "m", source=source)
        metrics.add("follow_from_taught_rms", _rms(self.repeated), "m", source=source)
        if self._is_oriented:
            metrics.add("follow_turn_from_taught", self.turns.max(), "rad", source=source)
        source = "actual from measured tool point"
        metrics.add("model_error_of_place", self.error.max(), "m", source=source)
        source = "change of this error between teaching and following"
        metrics.add("model_error_left", self.error_change.max(), "m", source=source)


def line_of(path: Path) -> FloatArray:
    """Return a path as a line of samples [m], shape (k, 3)."""
    begin, end = path.position.domain
    count = max(int(np.ceil(path.length / _LINE_STEP)), 2)
    line: FloatArray = path.position.derivatives(np.linspace(begin, end, count + 1), 0)[:, 0]
    return line


def _guided_tool(taught: Taught) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return actual positions, orientations and errors of the tool between first and last waypoint.

    A closed path is completed by a straight line from the last to the first.
    """
    y_measured, (y_t, R_e) = measured_tool(taught.log)[0], actual_tool(taught.log)
    error = y_t - y_measured
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


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


class NearestOnLine:
    """Projection of points on a line of samples.

    The closest point is searched on the two segments at the nearest sample, which is exact for
    segments shorter than the line's radius of curvature.

    Args:
        points: Finite points [m], shape (n, 3).
        line: Finite samples [m], shape (k, 3), k > 0; neighbours may coincide.

    Attributes:
        distances: Distances from the line [m], shape (n,).
        samples: Index of the sample before the closest point, shape (n,).
    """

    def __init__(self, points: FloatArray, line: FloatArray) -> None:
        # the last of each run of samples that coincide
        apart = np.flatnonzero(np.append(np.any(np.diff(line, axis=0), axis=1), True))
        line = line[apart]
        _, corner = cKDTree(line).query(points)
        samples, self._shares = corner, np.zeros(len(points))
        self.distances = np.linalg.norm(points - line[corner], axis=1)
        for shift in (-1, 0):
            side = np.clip(corner + shift, 0, max(len(line) - 2, 0))
            segment = line[np.minimum(side + 1, len(line) - 1)] - line[side]
            square = np.sum(segment**2, axis=1)
            along = np.sum((points - line[side]) * segment, axis=1) / np.where(square, square, 1.0)
            share = np.clip(along, 0.0, 1.0)
            distance = np.linalg.norm(points - line[side] - share[:, None] * segment, axis=1)
            closer = distance < self.distances
            self.distances = np.where(closer, distance, self.distances)
            samples = np.where(closer, side, samples)
            self._shares = np.where(closer, share, self._shares)
        self.samples = apart[samples]

    def at(self, values: FloatArray) -> FloatArray:
        """Return values at the samples, interpolated at the closest points, shape (n, ..)."""
        shares = self._shares.reshape(-1, *[1] * (values.ndim - 1))
        after = np.minimum(self.samples + 1, len(values) - 1)
        return values[self.samples] + shares * (values[after] - values[self.samples])
