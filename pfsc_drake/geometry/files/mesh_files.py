"""Vertices and triangles of OBJ, PLY and STL files."""

from pathlib import Path as FilePath
from typing import NamedTuple

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.files.number_table import quote, read_regular_file


def read_obj_vertices(file: FilePath) -> np.ndarray:
    """Return the vertices (lines `v x y z`) of an OBJ file in its own unit, [n, 3].

    Args:
        file: The file.

    Raises:
        InputError: It cannot be read, has no vertices, or a malformed one.
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


_NAMES = {
    "i1": ("char", "int8"),
    "u1": ("uchar", "uint8"),
    "i2": ("short", "int16"),
    "u2": ("ushort", "uint16"),
    "i4": ("int", "int32"),
    "u4": ("uint", "uint32"),
    "f4": ("float", "float32"),
    "f8": ("double", "float64"),
}
_TYPES = {name: kind for kind, names in _NAMES.items() for name in names}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_END = b"end_header"
_MAX_HEADER = 1 << 16


class _Element(NamedTuple):
    """Element declared by a header; a property without a type is a list."""

    name: str
    number: int
    properties: list[tuple[str, str | None]]


def read_ply_vertices(file: FilePath) -> np.ndarray:
    """Return x, y, z of the element `vertex` of a PLY file in its own unit, [n, 3].

    Args:
        file: The file.

    Raises:
        InputError: It cannot be read, is no PLY file or shorter than its header says, or has no
            vertices, or elements with lists before them.
    """
    data = read_regular_file(file, "PLY")
    at = data.find(_END, 0, _MAX_HEADER)
    body = data.find(b"\n", at) + 1 if at >= 0 else 0
    if not data.startswith(b"ply") or not body:
        raise InputError(f"{file}: is no PLY file; a header from 'ply' to 'end_header' is required")
    order, elements = _header(file, data[:at].decode("ascii", "replace").splitlines())
    names = [element.name for element in elements]
    if "vertex" not in names:
        raise InputError(f"{file}: no vertices; an element 'vertex' is required in a PLY file")
    before, vertex = elements[: names.index("vertex")], elements[names.index("vertex")]
    labels = [label for label, _ in vertex.properties]
    lists = any(kind is None for element in (*before, vertex) for _, kind in element.properties)
    if lists or not {"x", "y", "z"} <= set(labels) or len(set(labels)) < len(labels):
        raise InputError(
            f"{file}: element 'vertex' has {', '.join(labels)}; x, y and z, each once, are"
            " required, and no lists there or before"
        )
    if order:
        table = _binary_rows(data[body:], order, before, vertex)
    else:
        lines = [line for line in data[body:].splitlines() if line.strip()]
        begin = sum(element.number for element in before)
        complete = len(lines) >= sum(element.number for element in elements)
        table = _text_rows(lines[begin : begin + vertex.number], labels) if complete else None
    if table is None:
        raise InputError(
            f"{file}: does not hold the {vertex.number} vertices that its header says, or one that"
            " is none"
        )
    return table


def _header(file: FilePath, lines: list[str]) -> tuple[str, list[_Element]]:
    """Return the byte order, empty for text, and the elements."""
    order, elements = None, []
    for number, line in enumerate(lines[1:], start=2):
        match line.split():
            case [] | ["comment" | "obj_info", *_]:
                pass
            case ["format", kind, _] if kind in _ORDERS:
                order = _ORDERS[kind]
            case ["element", name, count] if count.isascii() and count.isdigit():
                elements.append(_Element(name, int(count), []))
            case ["property", "list", _, _, label] if elements:
                elements[-1].properties.append((label, None))
            case ["property", kind, label] if elements and kind in _TYPES:
                elements[-1].properties.append((label, _TYPES[kind]))
            case _:
                raise InputError(f"{file}, line {number}: '{quote(line)}' is unknown in a PLY file")
    if order is None:
        raise InputError(f"{file}: no format; one of {', '.join(_ORDERS)} is required")
    return order, elements


def _text_rows(lines: list[bytes], labels: list[str]) -> np.ndarray | None:
    """Return the vertices [n, 3] of lines, or None if they are malformed."""
    columns = [labels.index(axis) for axis in "xyz"]
    rows = [line.split() for line in lines]
    try:
        return (
            np.array([[float(row[column]) for column in columns] for row in rows]) if rows else None
        )
    except (ValueError, IndexError):
        return None


def _binary_rows(
    data: bytes, order: str, before: list[_Element], vertex: _Element
) -> np.ndarray | None:
    """Return the vertices [n, 3] of a binary file, or None if they are missing."""
    sizes = [
        element.number * sum(np.dtype(kind).itemsize for _, kind in element.properties)
        for element in before
    ]
    record = np.dtype([(label, f"{order}{kind}") for label, kind in vertex.properties])
    if len(data) < sum(sizes) + vertex.number * record.itemsize or not vertex.number:
        return None
    table = np.frombuffer(data, record, vertex.number, sum(sizes))
    return np.stack([table[axis].astype(float) for axis in "xyz"], axis=1)


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
    points = corners.reshape(-1, 3)
    # as np.unique by rows, several times as fast
    order = np.lexsort(points.T[::-1])
    is_new = np.any(np.diff(points[order], axis=0, prepend=np.nan) != 0.0, axis=1)
    indices = np.empty(len(points), dtype=int)
    indices[order] = np.cumsum(is_new) - 1
    return Triangles(points[order[is_new]], indices.reshape(-1, 3))


def _binary(data: bytes) -> np.ndarray | None:
    """Return the corners of a binary file, shape (t, 3, 3); None if its length does not fit.

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
    """Return corners of a text file, shape (t, 3, 3)."""
    words = data.split()
    columns = np.flatnonzero(np.array([word.lower() == b"vertex" for word in words], dtype=bool))
    try:
        numbers = [float(word) for i in columns for word in words[i + 1 : i + 4]]
        return np.array(numbers).reshape(-1, 3, 3)
    except ValueError:
        raise InputError(f"{file}: is no STL file, neither binary nor text") from None
