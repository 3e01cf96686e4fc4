"""STL files, binary and text."""

import struct

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.files.mesh_files import read_stl

# a tetrahedron, corners counterclockwise from outside
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3.5]])
FACES = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]


def binary(header=b"made by hand"):
    data = header.ljust(80) + struct.pack("<I", len(FACES))
    for face in FACES:
        data += struct.pack("<12fH", 0, 0, 0, *CORNERS[list(face)].ravel(), 7)
    return data


def text():
    lines = ["solid part of mine"]
    for face in FACES:
        lines += ["facet normal 0 0 0", " outer loop"]
        lines += [f"  vertex {x:g} {y:.3e} {z:g}" for x, y, z in CORNERS[list(face)]]
        lines += [" endloop", "endfacet"]
    return "\n".join([*lines, "endsolid"]).encode()


@pytest.mark.parametrize(
    "data", [binary(), binary(b"solid like text"), binary() + b"\n", text(), text().upper()]
)
def test_triangles_are_those_of_the_file(tmp_path, data):
    file = tmp_path / "part.stl"
    file.write_bytes(data)
    surface = read_stl(file)
    assert surface.vertices.shape == (4, 3)  # shared corners are one
    expected = np.array([CORNERS[list(face)] for face in FACES])
    np.testing.assert_allclose(surface.vertices[surface.triangles], expected, atol=1e-7)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "no triangles"),
        (b"solid nothing\nendsolid", "no triangles"),
        (b"hello world, this is no mesh " * 9, "no triangles"),
        (binary()[:-60], "no triangles"),
        (text().replace(b"3.5", b"three"), "neither binary nor text"),
        (text()[:-45], "neither binary nor text"),
        (text().replace(b"3.5", b"nan"), "finite"),
        (binary(b"x")[:80] + struct.pack("<I", 0), "no triangles"),
    ],
)
def test_what_is_no_stl_file_is_refused(tmp_path, data, reason):
    file = tmp_path / "part.stl"
    file.write_bytes(data)
    with pytest.raises(InputError, match=reason) as error:
        read_stl(file)
    assert str(file) in str(error.value)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="No such file"):
        read_stl(tmp_path / "none.stl")
