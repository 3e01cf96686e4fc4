"""Waypoint files."""

import os
from pathlib import Path as FilePath

import numpy as np
import pytest
from scipy.linalg import expm

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    WaypointTable,
    matrix_to_quaternion,
    path_from_waypoints,
    quaternion_to_matrix,
    read_waypoints,
    zyx_to_matrix,
    zyz_to_matrix,
)


def _write(folder: FilePath, text: str) -> FilePath:
    file = folder / "points.csv"
    file.write_text(text)
    return file


def test_positions_comments_and_column_order(tmp_path: FilePath) -> None:
    table = read_waypoints(
        _write(tmp_path, "# made by hand\n\nz, x, y\n3,1,2  # first\n\n# note\n6,4,5e0\n")
    )
    np.testing.assert_array_equal(table.positions, [[1, 2, 3], [4, 5, 6]])
    assert table.quaternions is None
    assert table.parameters is None


@pytest.mark.parametrize(("kind", "convert"), [("zyx", zyx_to_matrix), ("zyz", zyz_to_matrix)])
def test_euler_angles(tmp_path: FilePath, kind: str, convert) -> None:
    file = _write(tmp_path, f"x,y,z,{kind}_1,{kind}_2,{kind}_3\n0,0,0,0.1,0.2,0.3\n1,0,0,1,2,3\n")
    table = read_waypoints(file)
    expected = convert([[0.1, 0.2, 0.3], [1.0, 2.0, 3.0]])
    np.testing.assert_allclose(quaternion_to_matrix(table.quaternions), expected, atol=1e-14)


def test_quaternions_matrices_and_parameters(tmp_path: FilePath) -> None:
    table = read_waypoints(
        _write(tmp_path, "theta,x,y,z,qw,qx,qy,qz\n0,0,0,0,2,0,0,0\n1.5,1,0,0,0,0,0,3\n")
    )
    np.testing.assert_array_equal(table.quaternions, [[1, 0, 0, 0], [0, 0, 0, 1]])
    np.testing.assert_array_equal(table.parameters, [0, 1.5])
    names = ",".join(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))
    table = read_waypoints(_write(tmp_path, f"x,y,z,{names}\n0,0,0,0,-1,0,1,0,0,0,0,1\n"))
    half = np.sqrt(0.5)
    np.testing.assert_allclose(table.quaternions, [[half, 0, 0, half]], atol=1e-14)


MATRIX = ",".join(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x,y,Z\n1,2,3\n", r"points\.csv, line 1: column 'Z' is unknown; allowed: x, y, z"),
        ("x,y,z,zyx1,zyx2,zyx3\n", r"column 'zyx1' is unknown; .*; did you mean 'zyx_1'"),
        ("x,y,z,roll,pitch\n", "column 'yaw' is missing"),
        ("x,y,z,rx,ry\n", "column 'rz' is missing"),
        ("x,y,z,yaw,qw,qx,qy,qz\n", "one kind of orientation"),
        ("x,y,z,rx,ry,rz\n0,0,0,0,0,180\n", r"column rz: 180 rad; at most 12\.57 is allowed$"),
        ("x,y,z,roll,pitch,yaw\n0,0,0,0,0,180\n", "columns roll_deg, pitch_deg, yaw_deg"),
        ("x,y,z\n0,3,0,2,0,1\n", "6 values; 3 are required; .* separated by semicolons"),
        ("% milled\nG21\nG1 X1 Y2\n", "line 2: 'G21' is G-code"),
        ("N10 G90\nN20 G1 X1 Y2\n", "line 1: 'N10 G90' is G-code"),
        ("x,y\n1,2\n", r"line 1: column 'z' is missing"),
        ("x,y,z,qw,qx,qy\n1,2,3,4,5,6\n", "column 'qz' is missing"),
        ("x,y,z,x\n1,2,3,4\n", "column 'x' twice"),
        (f"x,y,z,qw,qx,qy,qz,{MATRIX}\n", "one kind of orientation"),
        ("# c\nx,y,z\n1,2,3\n1,two,3\n", r"line 4, column y: 'two'; a finite number"),
        ("x,y,z\n1,2,nan\n", r"line 2, column z: 'nan'"),
        ("x,y,z\n1,2,\n", r"line 2, column z: ''"),
        ("x,y,z\n1,2\n", "line 2: 2 values; 3 are required"),
        ("x,y,z\n", "no waypoints"),
        ("", "no waypoints"),
        ("theta,x,y,z\n1,0,0,0\n\n1,2,3,4\n", r"line 4, column theta: 1; more than the 1 of"),
        ("x,y,z,qw,qx,qy,qz\n0,0,0,0,0,0,0\n", r"line 2, columns qw\.\.qz"),
        (f"x,y,z,{MATRIX}\n0,0,0,1,0,0,0,1,0,0,0,2\n", r"line 2, columns r11\.\.r33: .*identity"),
        (f"x,y,z,{MATRIX}\n0,0,0,1,0,0,0,1,0,0,0,-1\n", r"determinant -1"),
        ("x,y,z\n1,2,1e300\n", r"line 2, column z: '1e300'"),
        ("x,y,z\n1,2,-1e5\n", r"line 2, column z: -100000 m; at most 10000 m"),
        ("0.5,0.1,0.2\n", "column '0.5' is unknown; .* the first line names the columns"),
        (
            "x,y,z,zyx_1,zyx_2,zyx_3\n0,0,0,0,0,180\n",
            r"column zyx_3: 180 rad; at most 12\.57 is allowed; for degrees name the columns "
            "zyx_deg_1, zyx_deg_2, zyx_deg_3",
        ),
        ("x,y,z,zyz_deg_1,zyz_deg_2,zyz_deg_3\n0,0,0,0,9e9,0\n", "zyz_deg_2: 9e.09 deg"),
    ],
)
def test_errors_name_the_location(tmp_path: FilePath, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        read_waypoints(_write(tmp_path, text))
    assert "\n" not in str(error.value)
    assert "points.csv" in str(error.value)


@pytest.mark.parametrize("kind", ["zyx", "zyz"])
def test_euler_angles_in_degrees(tmp_path: FilePath, kind: str) -> None:
    names = [f"x,y,z,{kind}{unit}_1,{kind}{unit}_2,{kind}{unit}_3" for unit in ("", "_deg")]
    angles = np.array([[10.0, 20.0, -30.0], [170.0, 45.0, 190.0]])
    tables = []
    for header, values in zip(names, (np.deg2rad(angles), angles), strict=True):
        rows = "\n".join("0,0,0," + ",".join(map(repr, row)) for row in values.tolist())
        tables.append(read_waypoints(_write(tmp_path, f"{header}\n{rows}\n")).quaternions)
    np.testing.assert_allclose(tables[1], tables[0], atol=1e-15)


@pytest.mark.parametrize(
    ("cell", "shown"),
    [
        ("1_0", "1_0"),
        ("\u0661", "\u0661"),
        ("infinity", "infinity"),
        ("1e400", "1e400"),
        ("0x10", "0x10"),
        ("7" * 10**6, "7" * 20 + "..." + "7" * 20),
        ("word" * 10**5, "word" * 5 + "..." + "word" * 5),
    ],
)
def test_what_is_no_number(tmp_path: FilePath, cell: str, shown: str) -> None:
    with pytest.raises(InputError) as caught:
        read_waypoints(_write(tmp_path, f"x,y,z\n1,2,3\n1,{cell},3\n"))
    assert f"line 3, column y: '{shown}'; a finite number" in str(caught.value)


@pytest.mark.parametrize("cell", ["-5", "+.5", "5.", "1e-3", "1E+2", "007"])
def test_what_is_a_number(tmp_path: FilePath, cell: str) -> None:
    table = read_waypoints(_write(tmp_path, f"x,y,z\n1,{cell},3\n"))
    assert table.positions[0, 1] == float(cell)


def test_what_is_no_regular_file(tmp_path: FilePath) -> None:
    os.mkfifo(tmp_path / "pipe")
    for name, part in ((tmp_path / "pipe", "is a FIFO"), (FilePath("/dev/zero"), "is a device")):
        with pytest.raises(InputError, match=f"{name}: {part}"):
            read_waypoints(name)
    with pytest.raises(InputError, match="a readable CSV file is required"):
        read_waypoints("a\0b")


def test_files_that_are_too_large(tmp_path: FilePath) -> None:
    file = tmp_path / "points.csv"
    with file.open("wb") as stream:
        stream.truncate(300 << 20)  # sparse: it takes no room
    with pytest.raises(InputError, match="300 MiB, at most 256 are read"):
        read_waypoints(file)


def test_waypoints_that_are_too_many_for_a_spline() -> None:
    line = np.linspace(0.0, 1.0, 60_000)
    table = WaypointTable(np.stack([line, line, line], axis=1))
    with pytest.raises(InputError, match=r"60000; .* at most 50000: write path\.shape\.tolerance"):
        path_from_waypoints(table, smoothness=3)


def test_a_path_of_no_length() -> None:
    table = WaypointTable(1e-300 * np.arange(30.0).reshape(10, 3))
    with pytest.raises(InputError, match=r"waypoints: 0 m .* at least 0\.0001 m"):
        path_from_waypoints(table, smoothness=3)


@pytest.mark.slow
def test_progress_of_reading(tmp_path: FilePath) -> None:
    told: list[tuple[float, str]] = []
    rows = "1,2,3\n" * 120_000
    file = _write(tmp_path, f"x,y,z\n{rows}")
    read_waypoints(file, lambda fraction, phase: told.append((fraction, phase)))
    assert [phase for _, phase in told] == ["reading the waypoints"] * 2
    np.testing.assert_allclose([part for part, _ in told], [5 / 12, 10 / 12], atol=1e-4)


def test_a_small_closing_gap_counts(tmp_path: FilePath) -> None:
    """The revolution ends at the first point, where its orientation is, not at the last one."""
    angle = np.linspace(0.0, 2.0 * np.pi - 1e-4, 40)
    positions = 0.3 * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    quaternions = zyx_to_matrix(np.stack([0.3 * np.sin(angle), 0 * angle, 0 * angle], axis=1))
    table = WaypointTable(positions, matrix_to_quaternion(quaternions))
    path = path_from_waypoints(table, smoothness=3, closed=True)
    assert path.orientation.period == pytest.approx(path.position.period, rel=1e-12)
    theta = path.waypoints.parameters
    np.testing.assert_allclose(path.position.derivatives(theta[-2], 0)[0], positions[-1], atol=1e-9)
    reached = path.orientation.rotation_matrix(theta[[-2, -1]])
    np.testing.assert_allclose(reached, quaternions[[-1, 0]], atol=1e-9)


def test_missing_file(tmp_path: FilePath) -> None:
    with pytest.raises(InputError, match=r"nothing\.csv: No such file"):
        read_waypoints(tmp_path / "nothing.csv")


@pytest.mark.parametrize("repeat", [False, True])
@pytest.mark.parametrize("parametrization", ["chord", "centripetal"])
def test_closed_path(tmp_path: FilePath, repeat: bool, parametrization) -> None:
    lines = ["x,y,z,zyx_1,zyx_2,zyx_3"]
    for k in range(12 + repeat):
        a = 2 * np.pi * (k % 12) / 12
        lines.append(f"{0.5 * np.cos(a)},{0.3 * np.sin(a)},1,{a},0,0")
    table = read_waypoints(_write(tmp_path, "\n".join(lines)))
    path = path_from_waypoints(table, smoothness=5, closed=True, parametrization=parametrization)
    path.require_smoothness(5, "elastic joints")
    assert path.orientation.period == pytest.approx(2 * path.position.period)
    closest_point = path.nearest(table.positions[3])
    np.testing.assert_allclose(
        path.orientation.rotation_matrix(closest_point), zyx_to_matrix([np.pi / 2, 0, 0]), atol=1e-8
    )


def test_given_parameters_are_used(tmp_path: FilePath) -> None:
    rows = [f"{t * t},{t},0,{0.1 * t},0,0,{t}" for t in range(8)]
    table = read_waypoints(_write(tmp_path, "x,y,z,zyx_1,zyx_2,zyx_3,theta\n" + "\n".join(rows)))
    path = path_from_waypoints(table, smoothness=3)
    np.testing.assert_allclose(
        path.position.derivatives(2.5, 1), [[6.25, 2.5, 0], [5, 1, 0]], atol=1e-10
    )
    assert path.orientation.domain == (0.0, 7.0)


def test_without_orientation(tmp_path: FilePath) -> None:
    table = read_waypoints(_write(tmp_path, "x,y,z\n0,0,0\n1,0,0\n2,1,0\n3,1,0\n"))
    assert path_from_waypoints(table, smoothness=2).orientation is None


@pytest.mark.parametrize("mark", [",", ";", "\t", "|", " ", " ; "])
def test_any_separator(tmp_path: FilePath, mark: str) -> None:
    rows = [["y", "x", "z"], ["1", "2", "3.5"], ["4", "5e-1", "6"]]
    expected = [[2.0, 1.0, 3.5], [0.5, 4.0, 6.0]]
    text = "\n".join(mark.join(row) for row in rows)
    np.testing.assert_array_equal(read_waypoints(_write(tmp_path, text)).positions, expected)
    if mark != ",":
        text = text.replace(".", ",")
        np.testing.assert_array_equal(read_waypoints(_write(tmp_path, text)).positions, expected)


def test_further_columns_are_ignored_with_a_note(tmp_path: FilePath) -> None:
    file = _write(tmp_path, 'stamp,"x","y","z",vx\nnoon,1,2,3,\nlater,4,5,6,7\n')
    table = read_waypoints(file)
    np.testing.assert_array_equal(table.positions, [[1, 2, 3], [4, 5, 6]])
    assert table.notes == (f"{file}: columns 'stamp', 'vx' ignored",)


def test_rotation_vectors_and_roll_pitch_yaw(tmp_path: FilePath) -> None:
    """Against products of matrices about single axes, and matrix exponentials."""
    rolls = np.array([[0.3, -0.4, 2.5], [-3.0, 1.2, 0.0]])

    def turn(axis: int, angle: float) -> np.ndarray:
        return expm(angle * np.cross(np.eye(3)[axis], np.eye(3)).T)

    for names, scale in (("roll,pitch,yaw", 1.0), ("roll_deg,pitch_deg,yaw_deg", 180.0 / np.pi)):
        rows = "\n".join("0,0,0," + ",".join(map(repr, row)) for row in (scale * rolls).tolist())
        found = read_waypoints(_write(tmp_path, f"x,y,z,{names}\n{rows}\n"))
        expected = [turn(2, w) @ turn(1, p) @ turn(0, r) for r, p, w in rolls]
        np.testing.assert_allclose(quaternion_to_matrix(found.quaternions), expected, atol=1e-14)
        assert not found.yaw_alone
    vectors = np.array([[0.0, 0.0, 0.0], [0.3, -2.0, 1.0], [1e-9, 0.0, 0.0]])
    rows = "\n".join("0,0,0," + ",".join(map(repr, row)) for row in vectors.tolist())
    found = read_waypoints(_write(tmp_path, f"x,y,z,rx,ry,rz\n{rows}\n"))
    expected = [expm(np.cross(v, np.eye(3)).T) for v in vectors]
    np.testing.assert_allclose(quaternion_to_matrix(found.quaternions), expected, atol=1e-14)


def test_yaw_alone(tmp_path: FilePath) -> None:
    table = read_waypoints(_write(tmp_path, "x,y,z,yaw_deg\n0,0,0,90\n1,0,0,-60\n"))
    assert table.yaw_alone
    half = np.deg2rad([45.0, -30.0])
    expected = np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=1)
    np.testing.assert_allclose(table.quaternions, expected, atol=1e-15)


def test_units_scale_positions_alone(tmp_path: FilePath) -> None:
    file = _write(tmp_path, "theta,x,y,z,rx,ry,rz\n0,1,2,3,0.1,0,0\n5,4,5,6,0.2,0,0\n")
    table, scaled = read_waypoints(file), read_waypoints(file, unit="inch")
    np.testing.assert_allclose(scaled.positions, 0.0254 * table.positions)
    np.testing.assert_array_equal(scaled.quaternions, table.quaternions)
    np.testing.assert_array_equal(scaled.parameters, table.parameters)
    with pytest.raises(InputError, match="unit: 'km'; one of m, cm, mm, inch"):
        read_waypoints(file, unit="km")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="at most 10000 m"):
        read_waypoints(_write(tmp_path, "x,y,z\n1,2,2e4\n"))
    read_waypoints(_write(tmp_path, "x,y,z\n1,2,2e4\n"), unit="mm")


def test_equal_rows_are_left_out_with_a_note(tmp_path: FilePath) -> None:
    file = _write(tmp_path, "stamp,x,y,z\n1,0,0,1\n2,0,0,1\n3,0,1,1\n4,0,0,1\n5,0,0,1\n")
    table = read_waypoints(file)
    np.testing.assert_array_equal(table.positions, [[0, 0, 1], [0, 1, 1], [0, 0, 1]])
    assert f"{file}: 2 rows equal the row before, first in line 3" in table.notes[1]
