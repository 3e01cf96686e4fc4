"""Reading STL files, binary and text, which Drake does not draw."""

from pathlib import Path as FilePath

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.systems.drawing.robot_visualizer import Surface

_HEADER, _COUNT = 80, 4  # bytes before the number of triangles, and of it
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl(file: FilePath) -> Surface:
    """Return the triangles of an STL file in its own unit; equal corners become one vertex.

    Args:
        file: The file.

    Raises:
        InputError: If it cannot be read or holds no triangles with finite corners.
    """
    try:
        data = file.read_bytes()
    except OSError as error:
        raise InputError(f"{file}: {error.strerror}") from None
    corners = _binary(data)
    if corners is None:
        corners = _text(data, file)
    if not len(corners) or not np.isfinite(corners).all():
        raise InputError(f"{file}: holds no triangles with finite corners")
    vertices, indices = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    return Surface(vertices, indices.reshape(-1, 3))


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
