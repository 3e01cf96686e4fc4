"""Files of points scanned on a surface."""

import struct

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.surfaces.point_file import read_surface_file, read_surface_points

POINTS = np.array([[0.0, 0.0, 0.5], [1.0, 0.0, 0.25], [0.0, 2.0, 0.0], [0.0, 0.0, 3.5]])
CSV = b"z, x, y  # scanned\n" + b"".join(b"%g,%g,%g\n" % (z, x, y) for x, y, z in POINTS)
OBJ = b"# by a scanner\no patch\n" + b"".join(b"v %g %g %g 1.0\n" % tuple(p) for p in POINTS)
OBJ += b"vn 0 0 1\nf 1//1 2//1 3//1\n"
FACES = [(0, 1, 2), (0, 1, 3)]


def stl():
    data = b"patch".ljust(80) + struct.pack("<I", len(FACES))
    for face in FACES:
        data += struct.pack("<12fH", 0, 0, 0, *POINTS[list(face)].ravel(), 0)
    return data


def ply(form, points=POINTS, count=4, extra=True):
    header = ["ply", f"format {form} 1.0", "comment by a scanner"]
    if extra:
        header += ["element camera 1", "property double view_x", "property uchar kind"]
    header += [f"element vertex {count}", "property float32 x", "property double y"]
    header += ["property uchar red", "property float z"]
    header += ["element face 1", "property list uchar int vertex_indices", "end_header"]
    data = "\n".join([*header, ""]).encode()
    order = ">" if form.endswith("big_endian") else "<"
    if extra:
        data += b"0.5 3\n" if form == "ascii" else struct.pack(f"{order}dB", 0.5, 3)
    for x, y, z in points:
        if form == "ascii":
            data += b"%g %g 200 %g\n" % (x, y, z)
        else:
            data += struct.pack(f"{order}fdBf", x, y, 200, z)
    return data + (b"3 0 1 2\n" if form == "ascii" else struct.pack(f"{order}B3i", 3, 0, 1, 2))


FORMS = ["ascii", "binary_little_endian", "binary_big_endian"]


def write(tmp_path, name, data):
    file = tmp_path / name
    file.write_bytes(data)
    return file


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("scan.csv", CSV),
        ("scan.CSV", b"\xef\xbb\xbf" + CSV.replace(b"\n", b"\r\n")),
        ("scan.obj", OBJ),
        ("scan.stl", stl()),
        *((f"{form}.ply", ply(form, extra=extra)) for form in FORMS for extra in (True, False)),
        ("crlf.ply", ply("ascii").replace(b"\n", b"\r\n")),
    ],
)
def test_points_are_those_of_the_file(tmp_path, name, data):
    found = read_surface_points(write(tmp_path, name, data))
    np.testing.assert_allclose(sorted(found.tolist()), sorted(POINTS.tolist()), atol=1e-7)
    found = read_surface_points(write(tmp_path, name, data), "mm")
    np.testing.assert_allclose(sorted(found.tolist()), sorted((0.001 * POINTS).tolist()), atol=1e-9)


def test_equal_vertices_are_taken_once_in_the_order_of_the_file(tmp_path):
    file = write(tmp_path, "a.obj", b"v 3 0 0\nv 1 0 0\nv 3 0 0\nv 2 0 0\n")
    np.testing.assert_array_equal(read_surface_points(file)[:, 0], [3.0, 1.0, 2.0])


def test_equal_points_of_a_scan_are_taken_once_and_reported(tmp_path):
    file = write(tmp_path, "a.csv", b"x,stamp,y,z\n3,1,0,0\n1,2,0,0\n3,3,0,0\n2,4,0,0\n1,5,0,0\n")
    points, notes = read_surface_file(file)
    np.testing.assert_array_equal(points[:, 0], [3.0, 1.0, 2.0])
    assert [note.removeprefix(f"{file}: ") for note in notes] == [
        "column 'stamp' ignored",
        "points that are there already left out: 2, of which the first is in line 4",
    ]


@pytest.mark.parametrize(
    ("name", "data", "reason"),
    [
        ("a.csv", b"", "no points"),
        ("a.csv", b"x,y,z\n", "no points"),
        ("a.csv", b"x,y\n1,2\n", "line 1: column 'z' is missing"),
        ("a.csv", b"x,y,Z\n1,2,3\n", "column 'Z' is unknown; allowed: x, y, z"),
        ("a.csv", b"1,2,3\n4,5,6\n", "the first line names the columns"),
        ("a.csv", b"x,y,z,x\n1,2,3,4\n", "column 'x' twice"),
        ("a.csv", b"x,y,z\n1,2\n", "line 2: 2 values; 3 are required"),
        ("a.csv", b"x,y,z\n1,nan,3\n", "line 2, column y: 'nan'; a finite number"),
        ("a.csv", b"x,y,z\n1,2,3\n1,2,2e5\n", "line 3, z: 200000 m"),
        ("a.csv", b"x,y,z\n1,2,3\n1,2,200\n", "197 m from end to end; .* is its unit mm"),
        ("a.csv", b"\xff\xfe\x00", "not a text file; a readable CSV file"),
        ("a.txt", CSV, "kinds .csv, .stl, .obj, .ply"),
        ("a.obj", b"", "no vertices; lines 'v x y z'"),
        ("a.obj", b"v 1 2\n", "line 1: 'v 1 2'; 'v' and three numbers"),
        ("a.obj", b"v 1 2 x\n", "line 1: 'v 1 2 x'"),
        ("a.obj", b"v 1 2 nan\n", "vertex 1, z: nan m"),
        ("a.stl", b"solid\nendsolid", "no triangles"),
        ("a.ply", b"", "is no PLY file"),
        ("a.ply", OBJ, "is no PLY file"),
        ("a.ply", ply("ascii").replace(b"ascii", b"packed"), "line 2: 'format packed 1.0'"),
        ("a.ply", ply("ascii").replace(b"format ascii 1.0\n", b""), "no format"),
        ("a.ply", ply("ascii").replace(b"vertex 4", b"vertex 5"), "hold the 5 vertices"),
        ("a.ply", ply("ascii").replace(b"vertex 4", b"vertex 0"), "hold the 0 vertices"),
        ("a.ply", ply("ascii").replace(b"vertex 4", b"vertex -4"), "'element vertex -4'"),
        ("a.ply", ply("ascii").replace(b"vertex 4", b"point 4"), "no vertices; an element"),
        ("a.ply", ply("ascii").replace(b"32 x", b"32 nx"), "has nx, y, red, z"),
        ("a.ply", ply("ascii").replace(b"uchar red", b"list uchar int red"), "no lists"),
        ("a.ply", ply("ascii").replace(b"float32 x", b"quad x"), "'property quad x' is unknown"),
        ("a.ply", ply("ascii").replace(b"0.25", b"high"), "hold the 4 vertices"),
        ("a.ply", ply("ascii").replace(b"0.25", b"nan"), "vertex 2, z: nan m"),
        ("a.ply", ply("binary_big_endian")[:-30], "hold the 4 vertices"),
        ("a.ply", ply("binary_little_endian", count=10**12), "hold the 10{12} vertices"),
    ],
)
def test_what_holds_no_points_is_refused(tmp_path, name, data, reason):
    file = write(tmp_path, name, data)
    with pytest.raises(InputError, match=reason) as error:
        read_surface_points(file)
    assert str(file) in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["none.csv", "none.obj", "none.stl", "none.ply"])
def test_missing_files_and_folders_are_refused(tmp_path, name):
    with pytest.raises(InputError, match="No such file"):
        read_surface_points(tmp_path / name)
    (tmp_path / name).mkdir()
    with pytest.raises(InputError, match="Is a directory"):
        read_surface_points(tmp_path / name)


def test_an_unknown_unit_is_refused(tmp_path):
    with pytest.raises(InputError, match="unit: 'km'; one of m, cm, mm, inch"):
        read_surface_points(write(tmp_path, "a.csv", CSV), "km")


def test_further_columns_are_ignored_with_a_note(tmp_path):
    rows = "".join(f"{i};{x};{y};{z};late\n" for i, (x, y, z) in enumerate(POINTS.tolist()))
    file = write(tmp_path, "a.csv", f"nx;x;y;z;stamp\n{rows}".encode())
    found = read_surface_file(file, "cm")
    np.testing.assert_allclose(found.points, 0.01 * POINTS, atol=1e-12)
    assert found.notes == (f"{file}: columns 'nx', 'stamp' ignored",)
