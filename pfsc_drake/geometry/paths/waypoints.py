"""Paths through waypoints."""

import math
from dataclasses import dataclass

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.orientation import (
    OrientationCurve,
    check_neighbours,
    interpolate_orientation,
)
from pfsc_drake.geometry.curves.rounded_polygon import blend_distances, round_corners
from pfsc_drake.geometry.curves.spline import (
    Parametrization,
    accumulate,
    check_smoothness,
    close_polygon,
    interpolate,
)
from pfsc_drake.geometry.paths.path import Path, PathWaypoints
from pfsc_drake.geometry.paths.smoothing import smooth_orientation, smooth_positions
from pfsc_drake.geometry.paths.waypoint_file import WaypointTable
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.geometry.size import SHORTEST

# Splines through more waypoints would take minutes and gigabytes.
MAX_INTERPOLATED = 50_000


@dataclass(frozen=True)
class Tolerance:
    """How far a smooth path may be from its waypoints.

    Attributes:
        position: m, positive.
        orientation: rad, positive; 1 deg by default.
    """

    position: float
    orientation: float = math.radians(1.0)


def path_from_waypoints(
    table: WaypointTable,
    *,
    smoothness: int,
    closed: bool = False,
    parametrization: Parametrization = "chord",
    tolerance: Tolerance | float | None = None,
    corner_distance: float | None = None,
    progress: Progress | None = None,
) -> Path:
    """Path through waypoints, or near them.

    Args:
        table: Waypoints. For a closed path the last may repeat the first; it must if the
            table has parameters, because the period is not known otherwise.
        smoothness: k of the class C^k of position and orientation, 2..6.
        closed: True for a closed path.
        parametrization: "chord" or "centripetal", see `interpolate`.
        tolerance: If given, the smoothest path that comes as near as this to all waypoints,
            see `smooth_positions`; neighbours may then coincide. A number is that of positions, m.
        corner_distance: If given, m: the path consists of straight lines, blended up to this
            distance from each corner (at most half of the line), see `round_corners`.
        progress: Told the fraction done and what is done.

    Returns:
        The path; its `waypoints` are those of the table.

    Raises:
        InputError: options that exclude each other, too many waypoints or a path that is too
            short; else as `interpolate`, `interpolate_orientation` and `Path` do.
    """
    positions = table.positions
    length = float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())
    if not length >= SHORTEST:
        raise InputError(
            f"waypoints: {length:.3g} m from the first to the last; at least {SHORTEST:g} m are"
            " required"
        )
    check_smoothness(smoothness)
    if tolerance is not None:
        _require_no(table, corner_distance, "path.shape.tolerance")
        if not isinstance(tolerance, Tolerance):
            tolerance = Tolerance(tolerance)
        return _smooth_path(table, smoothness, closed, tolerance, progress)
    if len(positions) > MAX_INTERPOLATED:
        raise InputError(
            f"waypoints: {len(positions)}; a path through all of them may have at most"
            f" {MAX_INTERPOLATED}: write path.shape.tolerance (m), which thins them"
        )
    if corner_distance is not None:
        _require_no(table, None, "path.shape.corner_distance")
        return _rounded_path(table, smoothness, closed, corner_distance)
    position = interpolate(
        positions,
        smoothness=smoothness,
        closed=closed,
        parametrization=parametrization,
        parameters=table.parameters,
    )
    parameters = table.parameters
    polygon, chords = close_polygon(positions, closed)
    if parameters is None:
        parameters = accumulate(chords, parametrization)
    orientation = None
    if table.quaternions is not None:
        orientation = interpolate_orientation(
            table.quaternions, parameters, smoothness=smoothness, closed=closed
        )
    return Path(position, orientation, waypoints=PathWaypoints(polygon, parameters, "interpolated"))


def _require_no(table: WaypointTable, corner_distance: float | None, key: str) -> None:
    if table.parameters is not None:
        raise InputError(f"waypoints: have a column theta; {key} makes its own: leave one out")
    if corner_distance is not None:
        raise InputError(f"{key} and path.shape.corner_distance exclude each other: leave one out")


def _smooth_path(
    table: WaypointTable,
    smoothness: int,
    closed: bool,
    tolerance: Tolerance,
    progress: Progress | None,
) -> Path:
    position, theta = smooth_positions(
        table.positions,
        smoothness=smoothness,
        tolerance=tolerance.position,
        closed=closed,
        progress=progress,
    )
    orientation: OrientationCurve | None = None
    if table.quaternions is not None:
        orientation = smooth_orientation(
            table.quaternions,
            theta,
            position.domain[1],
            smoothness=smoothness,
            tolerance=tolerance.orientation,
            closed=closed,
        )
    return Path(position, orientation, waypoints=PathWaypoints(table.positions, theta, "smoothed"))


def _rounded_path(table: WaypointTable, smoothness: int, closed: bool, distance: float) -> Path:
    points, chords = close_polygon(table.positions, closed)
    theta = accumulate(chords, "chord")
    widths = blend_distances(points, distance, closed=closed)

    def rounded(values: np.ndarray, around: bool) -> Curve:
        return round_corners(values, theta, widths, smoothness=smoothness, closed=around)

    position, orientation = rounded(points, closed), None
    if table.quaternions is not None:
        q = table.quaternions
        if closed and len(q) < len(points):
            q = np.vstack([q, q[:1]])
        q = check_neighbours(q)
        orientation = OrientationCurve(rounded(q, closed))
    return Path(position, orientation, waypoints=PathWaypoints(points, theta, "rounded"))
