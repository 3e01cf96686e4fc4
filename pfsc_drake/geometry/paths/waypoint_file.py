"""Waypoint files."""

import re
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.paths.smoothing import Progress
from pfsc_drake.geometry.rotation import (
    matrix_to_quaternion,
    zyx_to_quaternion,
    zyz_to_quaternion,
)
from pfsc_drake.geometry.size import FARTHEST

MAX_ROWS = 1_000_000
_MAX_BYTES = 1 << 28
_ROWS_PER_REPORT = 50_000
_LARGEST = 1e12
# rad; two turns
_LARGEST_ANGLE = 4.0 * np.pi
_LARGEST_DEGREES = 3600.0
# float() also takes underscores and the digits of all scripts
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)

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
_KINDS = {
    stat.S_IFDIR: "Is a directory",
    stat.S_IFIFO: "is a FIFO",
    stat.S_IFCHR: "is a device",
    stat.S_IFBLK: "is a device",
    stat.S_IFSOCK: "is a socket",
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
    lines, header, rows = _read_numbers(name, progress)
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


def _read_numbers(name: str, progress: Progress | None) -> tuple[list[int], list[str], np.ndarray]:
    """Line numbers [n], column names [m] and values [n, m] of a file."""
    header: list[str] = []
    lines: list[int] = []
    rows: list[list[float]] = []
    for line, content, fraction in _contents(name):
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
        if len(rows) > MAX_ROWS:
            raise InputError(
                f"{name}: more than {MAX_ROWS} waypoints; so many are the most that are read"
            )
        if progress is not None and len(rows) % _ROWS_PER_REPORT == 0:
            progress(fraction, "reading the waypoints")
    if not rows:
        raise InputError(f"{name}: no waypoints; a line with column names and data are required")
    return lines, header, np.array(rows)


def _contents(name: str) -> Iterator[tuple[int, str, float]]:
    """Lines that say something: number, text without comment, and the fraction of the file."""
    try:
        status = FilePath(name).stat()
        kind = _KINDS.get(stat.S_IFMT(status.st_mode), "is no regular file")
        if not stat.S_ISREG(status.st_mode):
            raise OSError(0, kind)
        if status.st_size > _MAX_BYTES:
            raise OSError(0, f"{status.st_size >> 20} MiB, at most {_MAX_BYTES >> 20} are read")
        text = FilePath(name).read_text(encoding="utf-8-sig")
    # ValueError: bytes that are no UTF-8, or a name that no file can have.
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "not a text file"
        raise InputError(
            f"{_quote(name, 1000)}: {reason}; a readable CSV file is required"
        ) from error
    rows = text.splitlines()
    for line, content in enumerate(rows, start=1):
        content = content.partition("#")[0].strip()
        if content:
            yield line, content, line / len(rows)


def _check_header(name: str, line: int, header: list[str]) -> None:
    known = [
        *_POSITION,
        _PARAMETER,
        *(label for group in _ORIENTATIONS.values() for label in group),
    ]
    for label in header:
        if label not in known:
            commas = "" if not re.search("[;\t]", label) else "; separate columns by commas"
            raise InputError(
                f"{name}, line {line}: column '{_quote(label)}' is unknown; allowed:"
                f" {', '.join(known)}{commas}"
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
    value = float(cell) if _NUMBER.fullmatch(cell) else np.nan
    if not abs(value) <= _LARGEST:
        raise InputError(
            f"{name}, line {line}, column {label}: '{_quote(cell)}'; a finite number is required"
        )
    return value


def _quote(text: str, longest: int = 40) -> str:
    """Text for a message, its middle left out if it is long."""
    half = longest // 2
    return text if len(text) <= longest else f"{text[:half]}...{text[-half:]}"


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
