"""Wrong waypoints through the command line.

Status 2, one line on stderr that names the file, the thing, the value and what is allowed; nothing
is simulated.
"""

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


def test_duplicate_waypoints(refused, mine, tmp_path):
    csv(tmp_path, np.insert(POINTS, 4, POINTS[3], axis=0))
    place = str(POINTS[3].tolist())
    refused(mine(), "rows 3 and 4", place, "must differ", changes=spline())


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
