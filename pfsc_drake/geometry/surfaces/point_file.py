"""Files of points scanned on a surface."""

from pathlib import Path as FilePath
from typing import NamedTuple

import numpy as np

from pfsc_drake.checks import FARTHEST
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.files.mesh_files import read_obj_vertices, read_ply_vertices, read_stl
from pfsc_drake.geometry.files.number_table import Unit, check_columns, metres, read_numbers

_AXES = ["x", "y", "z"]
_MESHES = {
    ".stl": lambda file: read_stl(file).vertices,
    ".obj": read_obj_vertices,
    ".ply": read_ply_vertices,
}
# m; no robot reaches over a larger workpiece.
_LARGEST = 50.0


class SurfacePoints(NamedTuple):
    """Points of a file.

    Attributes:
        points: [n, 3], m.
        notes: Sentences on ignored parts of the file.
    """

    points: np.ndarray
    notes: tuple[str, ...]


def read_surface_points(file: str | FilePath, unit: Unit = "m") -> np.ndarray:
    """Read points scanned on a surface, see :func:`read_surface_file`.

    Returns:
        Points, [n, 3], m.
    """
    return read_surface_file(file, unit).points


def read_surface_file(file: str | FilePath, unit: Unit = "m") -> SurfacePoints:
    """Read points scanned on a surface, and report ignored data.

    Args:
        file: A CSV file with columns x, y, z in any order, others being ignored, or an STL, OBJ
            or PLY file whose vertices are taken. Equal points are taken once.
        unit: Unit of the numbers in it.

    Raises:
        InputError: An unknown kind of file or unit, one that cannot be read, columns that are
            missing or misspelled, values that are not finite, further
            than 1e4 m away or more than 50 m apart.
    """
    scale, notes = metres(unit), tuple[str, ...]()
    path = FilePath(file)
    kind = path.suffix.lower()
    if kind == ".csv":
        points, locations, notes = _read_csv(str(file))
    elif kind in _MESHES:
        # in the order of the file
        vertices = _MESHES[kind](path)
        points = vertices[np.sort(np.unique(vertices, axis=0, return_index=True)[1])]
        locations = [f"vertex {number}" for number in range(1, len(points) + 1)]
    else:
        raise InputError(
            f"{file}: points are read from files of the kinds .csv, {', '.join(_MESHES)}"
        )
    points = points * scale
    bad = np.argwhere(~(np.abs(points) <= FARTHEST))
    if bad.size:
        row, axis = bad[0]
        raise InputError(
            f"{file}, {locations[row]}, {'xyz'[axis]}: {points[row, axis]:g} m; a number of at most"
            f" {FARTHEST:g} is required"
        )
    size = float(np.ptp(points, axis=0).max())
    if size > _LARGEST:
        advice = ": is its unit mm?" if unit == "m" else ""
        raise InputError(
            f"{file}: {size:.4g} m from end to end; at most {_LARGEST:g} m are allowed{advice}"
        )
    return SurfacePoints(points, notes)


def _check_header(location: str, header: list[str]) -> None:
    check_columns(location, header, _AXES, _AXES, others=True)


def _read_csv(name: str) -> tuple[np.ndarray, list[str], tuple[str, ...]]:
    """Return points [n, 3] in the file's unit, their locations, and notes on ignored data."""
    table = read_numbers(name, "points", _check_header, known=_AXES)
    points = table.rows[:, [table.header.index(axis) for axis in _AXES]]
    unique = np.sort(np.unique(points, axis=0, return_index=True)[1])
    notes = table.notes(name)
    if again := len(points) - len(unique):
        line = table.lines[int(np.setdiff1d(np.arange(len(points)), unique)[0])]
        there = f"of which the first is in line {line}" if again > 1 else f"in line {line}"
        notes += (f"{name}: points that are there already left out: {again}, {there}",)
    return points[unique], [f"line {table.lines[row]}" for row in unique], notes


def read_profile(file: str | FilePath, columns: list[str]) -> SurfacePoints:
    """Read the points of a profile, and report ignored data.

    Args:
        file: CSV file.
        columns: Required columns, in any order, others being ignored.

    Returns:
        Points in the order of the file, [n, columns], m.

    Raises:
        InputError: The file cannot be read, columns are misspelled or missing, or a value is not a
            number or beyond 1e4 m.
    """
    name = str(file)

    def check_header(location: str, header: list[str]) -> None:
        check_columns(location, header, columns, columns, others=True)

    table = read_numbers(name, "points", check_header, known=columns)
    points = table.rows[:, [table.header.index(label) for label in columns]]
    far = np.argwhere(np.abs(points) > FARTHEST)
    if far.size:
        row, column = far[0]
        raise InputError(
            f"{name}, line {table.lines[row]}, column {columns[column]}: {points[row, column]:g} m;"
            f" at most {FARTHEST:g} m are allowed"
        )
    return SurfacePoints(points, table.notes(name))
