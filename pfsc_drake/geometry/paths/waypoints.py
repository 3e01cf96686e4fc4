"""Waypoint files."""

import math
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.orientation import interpolate_orientation
from pfsc_drake.geometry.curves.spline import Parametrization, accumulate, interpolate
from pfsc_drake.geometry.paths.path import Path
from pfsc_drake.geometry.rotation import (
    matrix_to_quaternion,
    zyx_to_quaternion,
    zyz_to_quaternion,
)

_POSITION = ("x", "y", "z")
_PARAMETER = "theta"
_ORIENTATIONS = {
    "zyx": ("zyx_1", "zyx_2", "zyx_3"),
    "zyz": ("zyz_1", "zyz_2", "zyz_3"),
    "quaternion": ("qw", "qx", "qy", "qz"),
    "matrix": tuple(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3)),
}


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


def read_waypoints(csv_path: str | FilePath) -> WaypointTable:
    """Read waypoints from a CSV file.

    The first line that is neither empty nor a comment (#) names the columns, in any order:
    `x, y, z` [m]; optionally one group of `zyx_1, zyx_2, zyx_3` [rad], (2.7),
    `zyz_1, zyz_2, zyz_3` [rad], (2.6), `qw, qx, qy, qz`, or `r11, r12, ..., r33`; and
    optionally `theta`.

    Args:
        csv_path: File name.

    Returns:
        The table.

    Raises:
        InputError: the file cannot be read, a column is unknown or missing, or a value is
            not a number, not finite, not increasing (theta) or not an orientation.
    """
    name = str(csv_path)
    lines, header, rows = _read_numbers(name)
    column = {label: rows[:, index] for index, label in enumerate(header)}
    positions = np.stack([column[label] for label in _POSITION], axis=1)
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


def path_from_waypoints(
    table: WaypointTable,
    *,
    smoothness: int,
    closed: bool = False,
    parametrization: Parametrization = "chord",
) -> Path:
    """Path through waypoints.

    Args:
        table: Waypoints. For a closed path the last may repeat the first; it must if the
            table has parameters, because the period is not known otherwise.
        smoothness: k of the class C^k of position and orientation, 2..6.
        closed: True for a closed path.
        parametrization: "chord" or "centripetal", see `interpolate`.

    Returns:
        The path.

    Raises:
        InputError: as `interpolate`, `interpolate_orientation` and `Path` do.
    """
    positions, parameters = table.positions, table.parameters
    position = interpolate(
        positions,
        smoothness=smoothness,
        closed=closed,
        parametrization=parametrization,
        parameters=parameters,
    )
    if table.quaternions is None:
        return Path(position)
    if parameters is None:
        chords = np.linalg.norm(np.diff(positions, axis=0), axis=1)
        gap = float(np.linalg.norm(positions[-1] - positions[0]))
        if closed and gap > 1e-9 * chords.sum():
            chords = np.append(chords, gap)
        parameters = accumulate(chords, parametrization)
    orientation = interpolate_orientation(
        table.quaternions, parameters, smoothness=smoothness, closed=closed
    )
    return Path(position, orientation)


def _read_numbers(name: str) -> tuple[list[int], list[str], np.ndarray]:
    """Line numbers [n], column names [m] and values [n, m] of a file."""
    try:
        text = FilePath(name).read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not a text file"
        raise InputError(f"{name}: {reason}; a readable CSV file is required") from error
    header: list[str] = []
    lines: list[int] = []
    rows: list[list[float]] = []
    for line, content in enumerate(text.splitlines(), start=1):
        content = content.partition("#")[0].strip()
        if not content:
            continue
        cells = [cell.strip() for cell in content.split(",")]
        if not header:
            header = cells
            _check_header(name, line, header)
            continue
        if len(cells) != len(header):
            raise InputError(
                f"{name}, line {line}: {len(cells)} values; {len(header)} are required"
            )
        rows.append([_number(name, line, *item) for item in zip(header, cells, strict=True)])
        lines.append(line)
    if not rows:
        raise InputError(f"{name}: no waypoints; a line with column names and data are required")
    return lines, header, np.array(rows)


def _check_header(name: str, line: int, header: list[str]) -> None:
    known = [
        *_POSITION,
        _PARAMETER,
        *(label for group in _ORIENTATIONS.values() for label in group),
    ]
    for label in header:
        if label not in known:
            raise InputError(
                f"{name}, line {line}: column '{label}' is unknown; allowed: {', '.join(known)}"
            )
        if header.count(label) > 1:
            raise InputError(f"{name}, line {line}: column '{label}' twice; once is allowed")
    present = [group for group in _ORIENTATIONS.values() if any(key in header for key in group)]
    if len(present) > 1:
        groups = " and ".join(f"'{group[0]}...'" for group in present)
        raise InputError(f"{name}, line {line}: columns {groups}; one kind of orientation allowed")
    for label in (*_POSITION, *(label for group in present for label in group)):
        if label not in header:
            raise InputError(f"{name}, line {line}: column '{label}' is missing; it is required")


def _number(name: str, line: int, label: str, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(
            f"{name}, line {line}, column {label}: '{cell}'; a finite number is required"
        )
    return value


def _to_quaternions(name: str, lines: list[int], kind: str, values: np.ndarray) -> np.ndarray:
    """Unit quaternions [n, 4] from the columns of one kind of orientation."""
    if kind == "zyx":
        return zyx_to_quaternion(values)
    if kind == "zyz":
        return zyz_to_quaternion(values)
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
