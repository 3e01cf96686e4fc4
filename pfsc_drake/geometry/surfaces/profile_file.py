"""Files of profiles: curves that leave surfaces when they are moved."""

from pathlib import Path as FilePath

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.files.number_table import check_columns, read_numbers
from pfsc_drake.geometry.size import FARTHEST


def read_profile(file: str | FilePath, columns: list[str]) -> np.ndarray:
    """Read the points of a profile.

    Args:
        file: CSV file.
        columns: That it must have, in any order, and no others.

    Returns:
        Points in the order of the file, [n, columns], m.

    Raises:
        InputError: The file cannot be read, columns are unknown or missing, or a value is not a
            number or beyond 1e4 m.
    """
    name = str(file)
    table = read_numbers(
        name, "points", lambda place, header: check_columns(place, header, columns, columns)
    )
    points = table.rows[:, [table.header.index(label) for label in columns]]
    far = np.argwhere(np.abs(points) > FARTHEST)
    if far.size:
        row, column = far[0]
        raise InputError(
            f"{name}, line {table.lines[row]}, column {columns[column]}: {points[row, column]:g} m;"
            f" at most {FARTHEST:g} m are allowed"
        )
    return points
