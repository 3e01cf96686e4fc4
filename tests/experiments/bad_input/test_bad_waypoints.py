"""Wrong waypoints through the command line.

Status 2, one line on stderr that names the file, the thing, the value and what is allowed; nothing
is simulated.
"""

import os

import numpy as np
import pytest

from experiments.cli import main

BARE = ("--no-figures", "--no-recording")
ANGLE = np.linspace(0.0, 1.5, 9)
POINTS = np.stack([0.8 + 0.0 * ANGLE, 0.2 * np.sin(ANGLE), 1.0 + 0.1 * ANGLE], axis=1)


def csv(folder, points=POINTS, header="x,y,z", name="points.csv"):
    rows = [",".join(map(str, row)) for row in np.asarray(points, dtype=object).tolist()]
    (folder / name).write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return folder / name


def spline(more=""):
    return [f"path.shape=!Waypoints {{file: points.csv{more}}}", "reference.points=[0.05, 0.1]"]


@pytest.mark.slow
def test_these_waypoints_are_fine(mine, tmp_path):
    csv(tmp_path)
    overrides = [argument for change in spline() for argument in ("--set", change)]
    out = tmp_path / "out"
    assert main(["run", mine(), "--out", str(out), "--duration", "0.02", *BARE, *overrides]) == 0


def test_missing_waypoints(refused, mine, tmp_path):
    file = tmp_path / "points.csv"
    refused(mine(), "No such file", "CSV", changes=spline(), file=file)
    file.mkdir()
    refused(mine(), "Is a directory", "CSV", changes=spline(), file=file)
    refused(mine(), "CSV", changes=["path.shape=!Waypoints {}"])


@pytest.mark.parametrize("bad", ["abc", "", "nan", "inf", "1,5"])
def test_a_bad_number_among_waypoints(refused, mine, tmp_path, bad):
    points = POINTS.astype(object)
    points[2, 1] = bad
    file = csv(tmp_path, points)
    refused(mine(), "line 4", changes=spline(), file=file)


@pytest.mark.parametrize(
    ("header", "part"), [("x,y,w", "'w'"), ("x,y,x", "'x'"), ("x,y", "'z'"), ("", "'0.8'")]
)
def test_columns_of_waypoints(refused, mine, tmp_path, header, part):
    refused(mine(), "line", part, changes=spline(), file=csv(tmp_path, header=header))


def test_binary_and_empty_waypoints(refused, mine, tmp_path):
    file = tmp_path / "points.csv"
    file.write_bytes(b"\xff\xfe\x00\x01")
    refused(mine(), "not a text file", changes=spline(), file=file)
    file.write_text("x,y,z\n", encoding="utf-8")
    refused(mine(), "no waypoints", changes=spline(), file=file)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("number", "allowed"), [("1e300", "10000 m"), ("1e-300", "10000 m"), ("1e999", "1.8e+308")]
)
def test_lengths_that_no_path_has(refused, mine, tmp_path, number, allowed):
    points = POINTS.astype(object)
    points[:, 1] = [f"{k}e{number.partition('e')[2]}" for k in range(1, 10)]
    points[:, [0, 2]] = 0
    csv(tmp_path, points)
    refused(mine(), "required", changes=spline())
    refused(mine(), "radius", allowed, changes=[f"path.shape=!Circle {{radius: {number}}}"])


def test_a_pipe_and_a_device_instead_of_waypoints(refused, mine, tmp_path):
    os.mkfifo(tmp_path / "points.csv")
    refused(mine(), "is a FIFO", changes=spline())
    refused(mine(), "is a device", changes=["path.shape=!Waypoints {file: /dev/zero}"])


def test_degrees_for_radians(refused, mine, tmp_path):
    rows = np.hstack([POINTS, np.full((9, 3), 90.0)])
    file = csv(tmp_path, rows, "x,y,z,zyx_1,zyx_2,zyx_3")
    refused(mine(), "line 2", "90 rad", "zyx_deg_1", changes=spline(), file=file)


@pytest.mark.slow
def test_a_tolerance_below_the_noise(refused, mine, tmp_path):
    angle = np.linspace(0.0, 1.5, 300)
    clean = np.stack([0.8 + 0.0 * angle, 0.2 * np.sin(angle), 1.0 + 0.1 * angle], axis=1)
    csv(tmp_path, clean + 2e-4 * np.random.default_rng(0).normal(size=clean.shape))
    refused(mine(), "tolerance = 5e-05 m", "allow", changes=spline(", tolerance: 5e-5"))
    parts = ("corner_distance", "tolerance")
    refused(mine(), *parts, changes=spline(", tolerance: 5e-5, corner_distance: 0.1"))


def test_too_few_waypoints(refused, mine, tmp_path):
    csv(tmp_path, POINTS[:6])
    refused(mine(), "6 distinct", "C^5", "at least 7", changes=spline())


def test_path_of_too_low_class(refused, mine, tmp_path):
    csv(tmp_path)
    parts = ("C^2", "C^5", "'elastic'", "theta = ")
    refused(mine(), *parts, changes=spline(", smoothness: 2"))
    parts = ("C^4", "C^5", "'elastic'")
    refused(mine(), *parts, changes=spline(", smoothness: 4"))


def test_reference_beyond_the_ends_of_an_open_path(refused, mine, tmp_path):
    csv(tmp_path)
    for point in (9.0, -0.01):
        changes = [*spline(), f"reference.points=[0.05, {point}]"]
        refused(mine(), "reference.points", f"{point:g} m", "open", "m long", changes=changes)


def test_reference_beyond_a_path_that_should_be_closed(refused, mine, tmp_path):
    angle = 2.0 * np.pi * np.arange(25) / 24
    flat = [0.8 + 0.1 * np.sin(angle), 0.1 * np.cos(angle), 1.0 + 0.0 * angle]
    csv(tmp_path, np.stack(flat, axis=1))
    changes = [*spline(), "reference.points=[0.05, 1.0]"]
    refused(mine(), "reference.points: 1 m", "path.shape.closed: true", changes=changes)
