"""Vertices of Wavefront OBJ files."""

from pathlib import Path as FilePath

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.files.number_table import quote
from pfsc_drake.geometry.files.regular_file import read_regular_file


def read_obj_vertices(file: FilePath) -> np.ndarray:
    """Return the vertices (lines `v x y z`) of an OBJ file in its own unit, [n, 3].

    Args:
        file: The file.

    Raises:
        InputError: It cannot be read, has no vertices, or one that is none.
    """
    vertices = []
    for number, line in enumerate(read_regular_file(file, "OBJ").splitlines(), start=1):
        words = line.split()
        if not words or words[0] != b"v":
            continue
        try:
            x, y, z = (float(word) for word in words[1:4])
        except ValueError:
            raise InputError(
                f"{file}, line {number}: '{quote(line.decode(errors='replace'))}'; 'v' and three"
                " numbers are required"
            ) from None
        vertices.append((x, y, z))
    if not vertices:
        raise InputError(f"{file}: no vertices; lines 'v x y z' are required in an OBJ file")
    return np.array(vertices)
