"""STL files, binary and text."""

from pathlib import Path as FilePath
from typing import NamedTuple

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.files.regular_file import read_regular_file

_HEADER, _COUNT = 80, 4  # bytes before the number of triangles, and of it
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


class Triangles(NamedTuple):
    """A mesh.

    Attributes:
        vertices: Points, shape (v, 3).
        triangles: Indices of their corners, counterclockwise from outside, shape (t, 3).
    """

    vertices: np.ndarray
    triangles: np.ndarray


def read_stl(file: FilePath) -> Triangles:
    """Return the triangles of an STL file in its own unit; equal corners become one vertex.

    Args:
        file: The file.

    Raises:
        InputError: If it cannot be read or holds no triangles with finite corners.
    """
    data = read_regular_file(file, "STL")
    corners = _binary(data)
    if corners is None:
        corners = _text(data, file)
    if not len(corners) or not np.isfinite(corners).all():
        raise InputError(f"{file}: holds no triangles with finite corners")
    vertices, indices = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    return Triangles(vertices, indices.reshape(-1, 3))


def _binary(data: bytes) -> np.ndarray | None:
    """Corners of a binary file, shape (t, 3, 3); None if its length says that it is none.

    The length decides, since binary files may well begin with "solid".
    """
    begin = _HEADER + _COUNT
    if len(data) < begin:
        return None
    count = int.from_bytes(data[_HEADER:begin], "little")
    if len(data) < begin + count * _RECORD.itemsize or (count == 0 and len(data) > begin):
        return None
    return np.frombuffer(data, _RECORD, count, begin)["corners"].astype(float)


def _text(data: bytes, file: FilePath) -> np.ndarray:
    """Corners of a text file, shape (t, 3, 3)."""
    words = data.split()
    places = np.flatnonzero(np.array([word.lower() == b"vertex" for word in words], dtype=bool))
    try:
        numbers = [float(word) for i in places for word in words[i + 1 : i + 4]]
        return np.array(numbers).reshape(-1, 3, 3)
    except ValueError:
        raise InputError(f"{file}: is no STL file, neither binary nor text") from None
