"""Waypoint files."""

from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.files.number_table import check_columns, read_numbers
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.geometry.rotation import (
    matrix_to_quaternion,
    zyx_to_quaternion,
    zyz_to_quaternion,
)
from pfsc_drake.geometry.size import FARTHEST

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
    "quaternion": ("qw", "qx", "qy", "qz"),
    "matrix": tuple(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3)),
}
_EULER = {"zyx": zyx_to_quaternion, "zyz": zyz_to_quaternion}


@dataclass(frozen=True)
class WaypointTable:
    """Waypoints of a path.

    Attributes:
        positions: [n, 3], m.
        quaternions: (w, x, y, z), [n, 4], or None without orientation.
        parameters: theta [n], strictly increasing, or None to choose them by distance.
    """

    positions: np.ndarray
    quaternions: np.ndarray | None = None
    parameters: np.ndarray | None = None


def read_waypoints(csv_path: str | FilePath, progress: Progress | None = None) -> WaypointTable:
    """Read waypoints from a CSV file.

    The first line that is neither empty nor a comment (#) names the columns, in any order:
    `x, y, z` [m], at most 1e4; optionally one group of `zyx_1, zyx_2, zyx_3` [rad], (2.7),
    `zyz_1, zyz_2, zyz_3` [rad], (2.6), the same in degrees as `zyx_deg_1, ...` or
    `zyz_deg_1, ...`, `qw, qx, qy, qz`, or `r11, r12, ..., r33`; and optionally `theta`.

    Args:
        csv_path: File name, of a regular file of at most 256 MiB and 1,000,000 waypoints.
        progress: Told the fraction read and what is done.

    Returns:
        The table.

    Raises:
        InputError: the file cannot be read or is too large, a column is unknown or missing,
            or a value is not a number, too large, not increasing (theta) or not an orientation.
    """
    name = str(csv_path)
    lines, header, rows = read_numbers(name, "waypoints", _check_header, progress)
    column = {label: rows[:, index] for index, label in enumerate(header)}
    positions = np.stack([column[label] for label in _POSITION], axis=1)
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
    quaternions = None
    for kind, labels in _ORIENTATIONS.items():
        if labels[0] in column:
            values = np.stack([column[label] for label in labels], axis=1)
            quaternions = _to_quaternions(name, lines, kind, values)
    return WaypointTable(positions, quaternions, parameters)


def waypoints_text(table: WaypointTable, comment: str = "") -> str:
    """Return waypoints as the content of a file that `read_waypoints` reads.

    Positions are rounded to 0.1 um, quaternions to 1e-9.

    Args:
        table: The waypoints; their parameters are left out.
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


def _check_header(place: str, header: list[str]) -> None:
    groups = list(_ORIENTATIONS.values())
    known = [*_POSITION, _PARAMETER, *(label for group in groups for label in group)]
    present = [group for group in groups if any(key in header for key in group)]
    check_columns(place, header, known, [])
    if len(present) > 1:
        kinds = " and ".join(f"'{group[0]}...'" for group in present)
        raise InputError(f"{place}: columns {kinds}; one kind of orientation allowed")
    required = [*_POSITION, *(label for group in present for label in group)]
    check_columns(place, header, known, required)


def _to_quaternions(name: str, lines: list[int], kind: str, values: np.ndarray) -> np.ndarray:
    """Unit quaternions [n, 4] from the columns of one kind of orientation."""
    convention = kind.removesuffix("_deg")
    if convention in _EULER:
        return _EULER[convention](_angles(name, lines, kind, values))
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
    """Euler angles [n, 3], rad, of columns in rad or degrees."""
    degrees = kind.endswith("_deg")
    largest = _LARGEST_DEGREES if degrees else _LARGEST_ANGLE
    far = np.argwhere(np.abs(values) > largest)
    if far.size:
        row, axis = far[0]
        advice = f"; for degrees name the columns {kind}_deg_1, {kind}_deg_2, {kind}_deg_3"
        raise InputError(
            f"{name}, line {lines[row]}, column {_ORIENTATIONS[kind][axis]}:"
            f" {values[row, axis]:g} {'deg' if degrees else 'rad'}; at most {largest:.4g} is"
            f" allowed{'' if degrees else advice}"
        )
    return np.deg2rad(values) if degrees else values
