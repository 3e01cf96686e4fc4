"""Waypoint files."""

from pathlib import Path as FilePath

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
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
        ("x,y,z,w\n1,2,3,4\n", r"points\.csv, line 1: column 'w' is unknown; allowed: x, y, z"),
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
    ],
)
def test_errors_name_the_place(tmp_path: FilePath, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        read_waypoints(_write(tmp_path, text))
    assert "\n" not in str(error.value)
    assert "points.csv" in str(error.value)


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
    foot = path.project_globally(table.positions[3])
    np.testing.assert_allclose(
        path.orientation.rotation_matrix(foot.theta), zyx_to_matrix([np.pi / 2, 0, 0]), atol=1e-8
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
