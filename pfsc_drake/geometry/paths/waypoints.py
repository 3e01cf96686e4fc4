"""Paths through waypoints."""

import math
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np

from pfsc_drake.checks import FARTHEST, SHORTEST
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.orientation_curve import (
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
from pfsc_drake.geometry.files.number_table import (
    NumberTable,
    Unit,
    check_columns,
    metres,
    read_numbers,
)
from pfsc_drake.geometry.paths.geometric_path import Path, PathWaypoints
from pfsc_drake.geometry.paths.path_smoothing import smooth_orientation, smooth_positions
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.geometry.rotation import (
    EULER_TO_QUATERNION,
    matrix_to_quaternion,
    rotation_vector_to_quaternion,
)

# rad; two turns
_LARGEST_ANGLE = 4.0 * np.pi
_LARGEST_DEGREES = 3600.0

_POSITION = ("x", "y", "z")
_PARAMETER = "theta"
_ORIENTATIONS = {
    "zyx": ("zyx_1", "zyx_2", "zyx_3"),
    "zyz": ("zyz_1", "zyz_2", "zyz_3"),
    "zyx_deg": ("zyx_deg_1", "zyx_deg_2", "zyx_deg_3"),
    "zyz_deg": ("zyz_deg_1", "zyz_deg_2", "zyz_deg_3"),
    "rpy": ("roll", "pitch", "yaw"),
    "rpy_deg": ("roll_deg", "pitch_deg", "yaw_deg"),
    "rotation_vector": ("rx", "ry", "rz"),
    "quaternion": ("qw", "qx", "qy", "qz"),
    "matrix": tuple(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3)),
}
# The last of roll, pitch, yaw may be the only column.
_YAW_ALONE = {"rpy": "yaw", "rpy_deg": "yaw_deg"}
_KNOWN = [*_POSITION, _PARAMETER, *(label for group in _ORIENTATIONS.values() for label in group)]


@dataclass(frozen=True)
class WaypointTable:
    """Waypoints of a path.

    Attributes:
        positions: [n, 3], m.
        quaternions: (w, x, y, z), [n, 4], or None without orientation.
        parameters: theta [n], strictly increasing, or None to choose them by distance.
        yaw_alone: Whether the orientation is a turn about z alone, tilts being unknown.
        notes: Sentences on ignored parts of a file.
    """

    positions: np.ndarray
    quaternions: np.ndarray | None = None
    parameters: np.ndarray | None = None
    yaw_alone: bool = False
    notes: tuple[str, ...] = ()


def read_waypoints(
    csv_path: str | FilePath, progress: Progress | None = None, unit: Unit = "m"
) -> WaypointTable:
    """Read waypoints from a CSV file.

    The first line that is neither empty nor a comment (#) names the columns, in any order:
    `x, y, z`, at most 1e4 m; optionally one group of `zyx_1, zyx_2, zyx_3` [rad], (2.7),
    `zyz_1, zyz_2, zyz_3` [rad], (2.6), `roll, pitch, yaw` [rad], about the fixed axes x, y, z, the
    same in degrees as `zyx_deg_1, ...`, `zyz_deg_1, ...` or `roll_deg, ...`, `yaw` or `yaw_deg`
    alone, the rotation vector `rx, ry, rz` [rad], `qw, qx, qy, qz`, or `r11, r12, ..., r33`; and
    optionally `theta`. Further columns are ignored. Without `theta` rows that equal the one before
    are skipped: recorders write them while a tool rests.

    Args:
        csv_path: File name, of a regular file of at most 256 MiB and 1,000,000 waypoints.
        progress: Callback with the fraction read and the name of the step.
        unit: Unit of `x, y, z`.

    Returns:
        The table.

    Raises:
        InputError: the file cannot be read or is too large, a column is unknown or missing,
            or a value is not a number, too large, not increasing (theta) or not an orientation.
    """
    name, scale = str(csv_path), metres(unit)
    table, equal = _without_repeats(
        name, read_numbers(name, "waypoints", _check_header, progress, _KNOWN)
    )
    lines, rows = table.lines, table.rows
    column = {label: rows[:, index] for index, label in enumerate(table.header)}
    positions = scale * np.stack([column[label] for label in _POSITION], axis=1)
    far = np.argwhere(np.abs(positions) > FARTHEST)
    if far.size:
        row, axis = far[0]
        raise InputError(
            f"{name}, line {lines[row]}, column {_POSITION[axis]}: {positions[row, axis]:g} m;"
            f" at most {FARTHEST:g} m from the origin are allowed"
        )
    parameters = column.get(_PARAMETER)
    if parameters is not None:
        bad = np.flatnonzero(np.diff(parameters) <= 0.0)
        if bad.size:
            row = int(bad[0]) + 1
            raise InputError(
                f"{name}, line {lines[row]}, column theta: {parameters[row]:.9g}; more than the"
                f" {parameters[row - 1]:.9g} of the line before is required"
            )
    quaternions, yaw_alone = None, False
    for kind, labels in _ORIENTATIONS.items():
        if labels[-1] in column:
            yaw_alone = labels[0] not in column
            values = np.stack([column.get(label, np.zeros(len(rows))) for label in labels], axis=1)
            quaternions = _to_quaternions(name, lines, kind, values)
    notes = (*table.notes(name), *equal)
    return WaypointTable(positions, quaternions, parameters, yaw_alone, notes)


def _without_repeats(name: str, table: NumberTable) -> tuple[NumberTable, tuple[str, ...]]:
    """Remove rows that equal the one before, and report them."""
    repeats = np.concatenate([[False], np.all(np.diff(table.rows, axis=0) == 0.0, axis=1)])
    count = int(np.count_nonzero(repeats))
    if not count or _PARAMETER in table.header:
        return table, ()
    first = table.lines[int(np.argmax(repeats))]
    lines = [line for line, repeated in zip(table.lines, repeats, strict=True) if not repeated]
    phrase = "1 row equals" if count == 1 else f"{count} rows equal"
    return table._replace(lines=lines, rows=table.rows[~repeats]), (
        f"{name}: {phrase} the row before, first in line {first}, and left out; waypoints are"
        " counted from 1 without them",
    )


def waypoints_text(table: WaypointTable, comment: str = "") -> str:
    """Return waypoints as the content of a file that `read_waypoints` reads.

    Positions are rounded to 0.1 um, quaternions to 1e-9.

    Args:
        table: The waypoints; their parameters are omitted.
        comment: One line, written first.
    """
    orientation = () if table.quaternions is None else _ORIENTATIONS["quaternion"]
    lines = [f"# {comment}"] if comment else []
    lines.append(",".join((*_POSITION, *orientation)))
    for i, position in enumerate(table.positions.tolist()):
        cells = [f"{value:.7f}" for value in position]
        if table.quaternions is not None:
            cells += [f"{value:.9f}" for value in table.quaternions[i].tolist()]
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"


def _check_header(location: str, header: list[str]) -> None:
    present = {
        kind: group for kind, group in _ORIENTATIONS.items() if any(key in header for key in group)
    }
    check_columns(location, header, _KNOWN, [], others=True)
    if len(present) > 1:
        kinds = " and ".join(f"'{group[0]}...'" for group in present.values())
        raise InputError(f"{location}: columns {kinds}; one kind of orientation allowed")
    required = list(_POSITION)
    for kind, group in present.items():
        if [label for label in group if label in header] != [_YAW_ALONE.get(kind)]:
            required += group
    check_columns(location, header, _KNOWN, required, others=True)


def _to_quaternions(name: str, lines: list[int], kind: str, values: np.ndarray) -> np.ndarray:
    """Return the unit quaternions [n, 4] from the columns of one kind of orientation."""
    convention = kind.removesuffix("_deg")
    if convention in EULER_TO_QUATERNION:
        return EULER_TO_QUATERNION[convention](_angles(name, lines, kind, values))
    if convention == "rpy":  # about fixed axes: in the other order about those that turn
        return EULER_TO_QUATERNION["zyx"](_angles(name, lines, kind, values)[:, ::-1])
    if kind == "rotation_vector":
        return rotation_vector_to_quaternion(_angles(name, lines, kind, values))
    if kind == "quaternion":
        norm = np.linalg.norm(values, axis=1, keepdims=True)
        bad = np.flatnonzero(norm[:, 0] < 1e-6)
        if bad.size:
            raise InputError(
                f"{name}, line {lines[bad[0]]}, columns qw..qz: {values[bad[0]].tolist()};"
                " a quaternion that is not zero is required"
            )
        return values / norm
    quaternions = []
    for line, value in zip(lines, values.reshape(-1, 3, 3), strict=True):
        try:
            quaternions.append(matrix_to_quaternion(value))
        except InputError as error:
            raise InputError(f"{name}, line {line}, columns r11..r33: {error}") from error
    return np.array(quaternions)


def _angles(name: str, lines: list[int], kind: str, values: np.ndarray) -> np.ndarray:
    """Return the Euler angles [n, 3], rad, of columns in rad or degrees."""
    degrees = kind.endswith("_deg")
    largest = _LARGEST_DEGREES if degrees else _LARGEST_ANGLE
    far = np.argwhere(np.abs(values) > largest)
    if far.size:
        row, axis = far[0]
        in_degrees = ", ".join(_ORIENTATIONS.get(f"{kind}_deg", ()))
        advice = f"; for degrees name the columns {in_degrees}" if in_degrees else ""
        raise InputError(
            f"{name}, line {lines[row]}, column {_ORIENTATIONS[kind][axis]}:"
            f" {values[row, axis]:g} {'deg' if degrees else 'rad'}; at most {largest:.4g} is"
            f" allowed{'' if degrees else advice}"
        )
    return np.deg2rad(values) if degrees else values


# Of a length.
_ROUNDING = 1e-9
# Splines through more waypoints would take minutes and gigabytes.
MAX_INTERPOLATED = 50_000


@dataclass(frozen=True)
class Tolerance:
    """Largest deviation of a smooth path from its waypoints.

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
    """Return a path through waypoints, or near them.

    Args:
        table: Waypoints. For a closed path the last may repeat the first; it must if the
            table has parameters, because the period is not known otherwise.
        smoothness: k of the class C^k of position and orientation, 2..6.
        closed: True for a closed path.
        parametrization: "chord" or "centripetal", see `interpolate`.
        tolerance: If set, the smoothest path within this distance of all waypoints,
            see `smooth_positions`; neighbours may then coincide. A number applies to positions, m.
        corner_distance: If set, m: the path consists of straight lines, blended up to this
            distance from each corner (at most half of the line), see `round_corners`.
        progress: Callback with the fraction done and the name of the step.

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
    return Path(
        position,
        orientation,
        waypoints=PathWaypoints(polygon, parameters, "interpolated"),
        notes=table.notes,
    )


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
    return Path(
        position,
        orientation,
        waypoints=PathWaypoints(table.positions, theta, "smoothed"),
        notes=table.notes,
    )


def _rounded_path(table: WaypointTable, smoothness: int, closed: bool, distance: float) -> Path:
    points, chords = close_polygon(table.positions, closed)
    theta = accumulate(chords, "chord")
    widths = blend_distances(points, distance, closed=closed)

    def round_off(values: np.ndarray, around: bool) -> Curve:
        return round_corners(values, theta, widths, smoothness=smoothness, closed=around)

    position, orientation = round_off(points, closed), None
    if table.quaternions is not None:
        q = table.quaternions
        if closed and len(q) < len(points):
            q = np.vstack([q, q[:1]])
        q = check_neighbours(q)
        orientation = OrientationCurve(round_off(q, closed))
    waypoints = PathWaypoints(points, theta, "rounded")
    notes = (*table.notes, *_cut_corners(chords, distance))
    return Path(position, orientation, waypoints=waypoints, notes=notes)


def _cut_corners(chords: np.ndarray, distance: float) -> tuple[str, ...]:
    """Report lines that are too short for the requested distance."""
    short = np.flatnonzero(chords < 2.0 * distance * (1.0 - _ROUNDING))
    if len(chords) < 2 or not short.size:
        return ()
    worst = int(np.argmin(chords))
    numbers = f"{worst + 1} and {(worst + 1) % len(chords) + 1}"
    return (
        f"path.shape.corner_distance = {distance:g} m is more than half of {short.size} of"
        f" {len(chords)} lines, of which the shortest, between waypoints {numbers}, has"
        f" {chords[worst]:.4g} m: corners there are rounded from half the line on",
    )
