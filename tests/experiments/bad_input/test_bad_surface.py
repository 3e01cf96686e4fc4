"""Wrong surfaces through the command line: status 2, one line that says what is allowed."""

import struct

import numpy as np
import pytest

from experiments.cli import main

BARE = ("--no-figures", "--no-recording")
SCENARIO = "sfc_viscoelastic_3r"
SQUARE = np.stack(np.meshgrid(*2 * [np.linspace(-0.3, 0.3, 25)], indexing="ij"), -1).reshape(-1, 2)
JITTER = np.random.default_rng(0).uniform(-0.005, 0.005, SQUARE.shape)


def dish(places=SQUARE + JITTER):
    x, y = places.T
    return np.column_stack([0.7 + x, y, 1.0 + 0.5 * (x**2 + y**2)])


def csv(folder, rows, header="x,y,z", name="points.csv"):
    lines = [",".join(map(str, row)) for row in np.asarray(rows, dtype=object).tolist()]
    (folder / name).write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")
    return folder / name


def fitted(more="", file="points.csv"):
    return [
        f"surface.shape=!Fitted {{file: {file}{more}}}",
        "start={theta: [0, 0], posture_deg: [0, 115, -10]}",
        "reference={places: [[0, 0], [0.1, 0.05]]}",
    ]


@pytest.fixture(name="wrong")
def fixture_wrong(refused, mine):
    """Return a function that runs the copied scenario with changes and checks the refusal."""

    def check(*parts, changes, file=None):
        refused(mine(SCENARIO), *parts, changes=changes, file=file)

    return check


@pytest.mark.slow
def test_these_points_are_fine(mine, tmp_path):
    csv(tmp_path, dish())
    changes = [part for change in fitted() for part in ("--set", change)]
    out = tmp_path / "out"
    assert (
        main(["run", mine(SCENARIO), "--out", str(out), "--duration", "0.02", *BARE, *changes]) == 0
    )
    # the copy in the results names its file wherever it is run from
    copy = out / "scenario.yaml"
    again = tmp_path / "again"
    assert main(["run", str(copy), "--out", str(again), "--duration", "0.02", *BARE]) == 0


def test_missing_files(wrong, tmp_path):
    file = tmp_path / "points.csv"
    wrong("No such file", changes=fitted(), file=file)
    file.mkdir()
    wrong("Is a directory", changes=fitted(), file=file)
    wrong("file: none", "write file: NAME", changes=["surface.shape=!Fitted {}"])
    wrong("file: none", changes=["surface.shape=!Revolved {}"])
    wrong(".csv", ".stl", changes=fitted(file="points.step"))


@pytest.mark.parametrize("kind", ["stl", "obj", "ply"])
def test_broken_meshes(wrong, tmp_path, kind):
    file = tmp_path / f"points.{kind}"
    file.write_bytes(b"\xff\xfe\x00\x01")
    wrong(changes=fitted(file=file.name), file=file)
    file.write_bytes(b"")
    wrong(changes=fitted(file=file.name), file=file)


def test_a_mesh_that_is_cut_off(wrong, tmp_path):
    file = tmp_path / "points.stl"
    file.write_bytes(bytes(80) + struct.pack("<I", 12) + bytes(120))
    wrong(changes=fitted(file=file.name), file=file)


@pytest.mark.parametrize("bad", ["abc", "", "nan", "inf"])
def test_bad_numbers(wrong, tmp_path, bad):
    rows = dish().astype(object)
    rows[2, 1] = bad
    wrong("line 4", changes=fitted(), file=csv(tmp_path, rows))


def test_columns(wrong, tmp_path):
    wrong("'w'", changes=fitted(), file=csv(tmp_path, dish(), "x,y,w"))
    wrong("'z'", changes=fitted(), file=csv(tmp_path, dish()[:, :2], "x,y"))
    file = csv(tmp_path, [[0.1, 0.2]], "x,y")
    wrong("radius", changes=["surface.shape=!Revolved {file: points.csv}"], file=file)
    wrong("'z'", changes=["surface.shape=!Extruded {file: points.csv}"], file=file)


def test_millimetres_taken_for_metres(wrong, tmp_path):
    csv(tmp_path, 1e3 * dish())
    wrong("is its unit mm?", changes=fitted())


def test_too_few_points(wrong, tmp_path):
    csv(tmp_path, dish()[:40])
    wrong("40", "from 50", changes=fitted())
    csv(tmp_path, [[0.1, 0.0], [0.1, 0.1], [0.1, 0.2]], "radius,height")
    wrong("3 distinct", "C^4", changes=["surface.shape=!Revolved {file: points.csv}"])


def test_a_hole(wrong, tmp_path):
    places = SQUARE + JITTER
    csv(tmp_path, dish(places[np.linalg.norm(places - 0.05, axis=1) > 0.15]))
    wrong("no point within", "largest_hole", changes=fitted())


def test_a_patch_that_folds_over(wrong, tmp_path):
    """A sphere, all of it, is no function over a plane or a cylinder."""
    directions = np.random.default_rng(0).normal(size=(1500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    csv(tmp_path, [0.7, 0.0, 1.0] + 0.2 * directions)
    wrong("folds over", changes=fitted())


def test_two_sheets(wrong, tmp_path):
    csv(tmp_path, np.vstack([dish(), dish() + np.array([0.0, 0.0, 0.1])]))
    wrong("sheets", changes=fitted())


def test_a_tolerance_below_the_noise(wrong, tmp_path):
    noise = np.random.default_rng(0).normal(size=(625, 1)) * [0.0, 0.0, 2e-4]
    csv(tmp_path, dish() + noise)
    wrong("tolerance", "1e-05 m", "allow", changes=fitted(", tolerance: 1e-5"))


def test_grids(wrong, tmp_path):
    csv(tmp_path, dish(SQUARE))
    wrong("grid = [24, 25]", "625", changes=fitted(", grid: [24, 25]"))
    wrong("grid", "[rows, columns]", changes=fitted(", grid: [25]"))
    wrong("interpolate", "grid", changes=fitted(", interpolate: true"))
    wrong("closed", "grid", changes=fitted(", closed: [true, false]"))
    wrong("base", "scattered", changes=fitted(", grid: [25, 25], base: plane"))
    wrong("tolerance", changes=fitted(", grid: [25, 25], interpolate: true, tolerance: 1e-3"))
    csv(tmp_path, dish(SQUARE[:75]))
    wrong("C^4", changes=fitted(", grid: [3, 25], interpolate: true"))
    wrong("grid = [25, 3]", "[3, 25]", "swapped", changes=fitted(", grid: [25, 3]"))


@pytest.mark.parametrize(
    ("more", "key"),
    [
        ("unit: yard", "unit"),
        ("base: sphere", "base"),
        ("smoothness: 1", "smoothness"),
        ("smoothness: 9", "smoothness"),
        ("tolerance: -1", "tolerance"),
        ("largest_hole: .inf", "largest_hole"),
        ("axis: [0, 0, 0]", "axis"),
        ("visible_from: [1, 2]", "visible_from"),
        ("along: [1, 2, .nan]", "along"),
        ("base_axis: [0, 0, 1]", "base"),
    ],
)
def test_values_of_keys(wrong, tmp_path, more, key):
    csv(tmp_path, dish())
    wrong(key, changes=fitted(f", {more}"))


def test_not_smooth_enough(wrong, tmp_path):
    csv(tmp_path, dish())
    parts = ("C^2", "'visco_elastic'", "C^4", "smoothness: 0")
    wrong(*parts, changes=fitted(", smoothness: 2"))


def test_a_profile_that_crosses_itself_or_the_axis(wrong, tmp_path):
    t = np.linspace(-2.0, 2.0, 40)
    csv(tmp_path, np.column_stack([0.7 + 0.1 * (t**3 - t), 0 * t, 1.0 + 0.1 * t**2]))
    wrong(
        "meets itself",
        "theta",
        changes=["surface.shape=!Extruded {file: points.csv, direction: [0, 1, 0]}"],
    )
    height = np.linspace(-0.1, 0.1, 20)
    csv(tmp_path, np.column_stack([height + 0.02, height]), "radius,height")
    wrong("radius = -0.08 m", "axis", changes=["surface.shape=!Revolved {file: points.csv}"])
    csv(tmp_path, np.column_stack([0.7 + t / 20, 0 * t, 1.0 + 0 * t]))
    changes = ["surface.shape=!Extruded {file: points.csv, direction: [1, 0, 0]}"]
    wrong("not regular", changes=changes)


@pytest.mark.slow
def test_an_inverted_normal_is_named(refused, mine):
    """The tool would have to come from below, through the table."""
    shape = "!Plane {{origin: [0.9, 0, 0.2], axis: [0, 0, {}]}}"
    changes = [
        "surface.orientation={kind: normal, angles_deg: [0, 0, 180]}",
        "start={posture_deg: [0, 105, -40, 0, 75, 0], offset: [0, 0]}",
        "reference.places=[[0, 0], [0.05, 0]]",
    ]
    wrong = [f"surface.shape={shape.format(-1)}", *changes]
    refused(mine("sfc_elastic_6r"), "normal [0.0, 0.0, -1.0] inverted", "reach", changes=wrong)


@pytest.mark.slow
def test_starts_and_ways(wrong, tmp_path):
    csv(tmp_path, dish())
    wrong("start.theta", changes=[*fitted(), "start.theta=[0.9, 0]"])
    wrong("beside the patch", changes=[*fitted(), "start.position=[1.2, 0, 1.0]"])
    wrong(
        "leaves the surface", "theta_1", changes=[*fitted(), "reference.places=[[0, 0], [0.5, 0]]"]
    )
    wrong("reference.places", changes=[*fitted(), "reference.places=[]"])


def test_no_surface_and_joints_too_few(wrong, tmp_path):
    wrong("surface: {shape:", changes=["surface=null"])
    wrong("3 joints for 6 outputs", changes=["surface.orientation.kind=normal"])


def test_a_start_between_two_sheets(wrong, tmp_path):
    """Of a pleat whose walls are 0.1 m apart."""
    up = np.linspace(0.0, 0.3, 15)
    around = np.linspace(0.0, np.pi, 12)[1:-1]
    left, right = np.stack([0 * up + 0.65, up + 1.0]), np.stack([0 * up + 0.75, up + 1.0])
    bottom = np.stack([0.7 - 0.05 * np.cos(around), 1.0 - 0.05 * np.sin(around)])
    x, z = np.hstack([left[:, ::-1], bottom, right])
    csv(tmp_path, np.column_stack([x, 0 * x, z]))
    pleat = ["surface.shape=!Extruded {file: points.csv, direction: [0, 1, 0], length: 0.3}"]
    wrong("start", "nearer to one", changes=[*pleat, "start.position=[0.701, 0.15, 1.2]"])
