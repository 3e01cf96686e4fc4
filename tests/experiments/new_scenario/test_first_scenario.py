"""A first scenario for a robot and points of a user's own: what is chosen, said, refused."""

import csv

import numpy as np
import pytest
import yaml
from pydrake.math import RollPitchYaw, RotationMatrix

from experiments.cli import main
from experiments.new_scenario.points_choice import POINTING, PointsChoice
from tests.experiments.new_scenario.arms import GRIPPER, INERTIAL, TOOL, arc, arm


@pytest.fixture
def init(tmp_path, capfd):
    """Return a function that writes model and points and calls ``init``."""

    def call(model, points, *arguments, columns="x,y,z"):
        (tmp_path / "arm.urdf").write_text(model, encoding="utf-8")
        with (tmp_path / "points.csv").open("w", encoding="utf-8") as file:
            file.write(f"{columns}\n")
            csv.writer(file).writerows(points)
        files = str(tmp_path / "arm.urdf"), str(tmp_path / "points.csv")
        out = tmp_path / "mine.yaml"
        status = main(["init", *files, "--out", str(out), *arguments])
        printed = capfd.readouterr()
        return status, out, printed.out, printed.err

    return call


def content(file):
    """Return a scenario's data, its tags left out."""

    class Loader(yaml.SafeLoader):
        pass

    Loader.add_multi_constructor(
        "!", lambda loader, tag, node: loader.construct_mapping(node, True)
    )
    return yaml.load(file.read_text(encoding="utf-8"), Loader)


def test_points_in_mm_and_a_gripper(init, tmp_path):
    model = arm(more=GRIPPER.format(mass=INERTIAL.format(0.2)))
    status, file, out, err = init(model, arc(scale=1e3))
    assert (status, err) == (0, "")
    data = content(file)
    assert data["robot"] == {
        "model": "arm.urdf",
        "tool_frame": "my_tcp",
        "fixed_joints": {"finger_1": 0.01},
    }
    assert data["path"]["shape"] == {"file": "points.csv", "unit": "mm"}
    # the wrist's limits rule out the first turn about the vertical
    (keyframe,) = data["path"]["orientation"]["keyframes"]
    assert keyframe["angles_deg"] in POINTING["down"][1:]
    assert "z axis down" in out
    assert data["controller"]["law"] == "rigid"
    assert data["reference"]["points"] == [0, "end"]
    for words in ("in m the points would be up to", "they do not move 'my_tcp'", "trial run"):
        assert words in out
    # what it says is measured on the simulated robot
    deviation = float(out.split("max_path_deviation ")[1].split()[0])
    assert 1e-9 < deviation < 1e-4


@pytest.mark.slow
def test_what_is_written_runs(init, run_scenario, tmp_path):
    status, file, *_ = init(arm(more=TOOL), arc())
    assert status == 0
    run = run_scenario(tmp_path / "out", file)
    assert run.status == 0
    assert run.metrics["max_path_deviation"]["value"] < 1e-4
    assert run.stdout.count("warning") == 0


@pytest.mark.slow
def test_kinematics_alone(init):
    """A model without masses: its joints follow velocity servos."""
    status, file, out, err = init(arm(inertial="", more=TOOL), arc(), "--orientation", "free")
    assert (status, err) == (0, "")
    data = content(file)
    assert data["controller"]["law"] == "velocity_servo"
    assert "moves and has no <inertial>" in out
    assert data["path"]["orientation"] == {"task": "none"}
    assert [*data["controller"]["gains"]["velocity_servo"]] == ["eta", "xi"]


@pytest.mark.slow
def test_three_joints_and_few_points_of_a_closed_path(init):
    square = np.array([[0, 0], [0.2, 0], [0.2, 0.15], [0, 0.15], [0, 0]])
    points = np.column_stack([0.4 + 0 * square[:, 0], square[:, 0] - 0.1, 0.5 + square[:, 1]])
    more = TOOL.replace("l6", "l3").replace("<child", '<origin xyz="0.4 0 0"/><child')
    status, file, out, err = init(arm(joints=3, more=more), points)
    assert (status, err) == (0, "")
    shape = content(file)["path"]["shape"]
    assert shape == {"file": "points.csv", "closed": True, "corner_distance": 0.02}
    assert "the last point is the first one" in out
    assert content(file)["path"]["orientation"] == {"task": "none"}


@pytest.mark.slow
def test_orientation_of_the_file(init):
    rows = np.column_stack([arc(), np.tile([0.1, 1.4, 0.0], (9, 1))])
    columns = "x,y,z,roll,pitch,yaw"
    status, file, *_ = init(arm(more=TOOL), rows, "--law", "velocity_servo", columns=columns)
    assert status == 0
    assert "orientation" not in content(file)["path"]
    assert content(file)["controller"]["law"] == "velocity_servo"


@pytest.mark.parametrize(
    ("points", "arguments", "message"),
    [
        (arc(offset=(3.0, 0.0, 0.0)), (), "the robot reaches 1.2"),
        (arc(), ("--unit", "km"), "--unit km: allowed: m, cm, mm, inch"),
        (arc(), ("--tool-frame", "tool"), "did you mean 'tool0'"),
        (arc(), ("--orientation", "sideways"), "allowed: down, forward, up, free"),
        (arc(), ("--base-position", "1,2"), "--base-position 1,2: allowed: three numbers"),
        pytest.param(arc(), ("--law", "elastic"), "elastic", marks=pytest.mark.slow),
        (arc(), ("--law", "rigit"), "--law rigit: allowed: velocity_servo, rigid,"),
        (arc()[:1], (), "points.csv: 1 point; allowed: 2 different points or more"),
        (arc()[[1, 1, 1]], (), "points.csv: 1 point; allowed: 2 different points or more"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(init, points, arguments, message):
    status, file, _, err = init(arm(more=TOOL), points, *arguments)
    assert status == 2
    assert err.startswith("error: ") and err.count("\n") == 1
    assert message in err
    assert not file.exists()


def test_an_arm_of_two_joints_is_none(init):
    status, _, _, err = init(arm(joints=2), arc())
    assert status == 2
    assert "allowed: the model of an arm" in err


def test_nothing_is_overwritten(init, tmp_path):
    (tmp_path / "mine.yaml").write_text("mine", encoding="utf-8")
    status, file, _, err = init(arm(more=TOOL), arc())
    assert status == 2
    assert f"{file}: exists; allowed: a new file" in err
    assert file.read_text(encoding="utf-8") == "mine"


@pytest.mark.slow
def test_a_noisy_recording_is_smoothed(init):
    points = arc(count=200) + np.random.default_rng(0).normal(scale=2e-4, size=(200, 3))
    status, file, out, err = init(arm(inertial="", more=TOOL), points, "--orientation", "free")
    assert (status, err) == (0, "")
    tolerance = content(file)["path"]["shape"]["tolerance"]
    assert 2e-4 < tolerance < 4e-3  # m: some times the noise
    assert "a spline through all would bend to and fro" in out
    # the length is that of the smooth path, not of the noise
    length = float(out.split("reference.velocity")[1].split(" m of path")[0].split()[-1])
    assert length == pytest.approx(1.5 * np.hypot(0.1, 0.02), rel=0.02)


@pytest.mark.parametrize(
    ("name", "axis"), [("down", [0, 0, -1]), ("forward", [1, 0, 0]), ("up", [0, 0, 1])]
)
def test_directions_with_quarter_turns(name, axis):
    turns = [RotationMatrix(RollPitchYaw(np.deg2rad(a[::-1]))).matrix() for a in POINTING[name]]
    for R in turns:
        np.testing.assert_allclose(R[:, 2], axis, atol=1e-12)
    angles = [np.trace(turns[0].T @ R) for R in turns]  # 1 + 2 cos
    np.testing.assert_allclose(angles, [3.0, -1.0, 1.0, 1.0], atol=1e-12)


@pytest.mark.parametrize(("unit", "scale"), [("m", 1.0), ("cm", 1e2), ("mm", 1e3)])
def test_units(unit, scale, tmp_path):
    np.savetxt(tmp_path / "p.csv", arc(scale=scale), delimiter=",", header="x,y,z", comments="")
    points = PointsChoice(str(tmp_path / "p.csv"), "", np.zeros(3), 1.2)
    assert points.unit == unit
    assert points.length == pytest.approx(1.5 * np.hypot(0.1, 0.02), rel=0.01)


def choice(points, tmp_path):
    """Return the choices about points [m]."""
    np.savetxt(tmp_path / "p.csv", points, delimiter=",", header="x,y,z", comments="", fmt="%.9f")
    return PointsChoice(str(tmp_path / "p.csv"), "m", np.zeros(3), 2.0)


def test_smoothing(tmp_path):
    """Coincident points get a tolerance, points of straight lines corners, smooth ones neither."""
    smooth = choice(arc(count=30), tmp_path)
    assert (smooth.tolerance, smooth.corner_distance) == (0.0, 0.0)
    twice = np.insert(arc(count=30), 10, arc(count=30)[9] + [1e-6, 0.0, 0.0], axis=0)
    near = choice(twice, tmp_path)
    assert (near.tolerance, near.corner_distance) == (1e-4, 0.0)
    assert near.reasons["tolerance"] == "points 10 and 11 nearly coincide"
    side = np.linspace(0.0, 0.2, 5)
    corner = [np.stack([side, 0.0 * side, 1.0 + 0.0 * side], axis=1)]
    corner.append(np.stack([0.2 + 0.0 * side, side, 1.0 + 0.0 * side], axis=1)[1:])
    sharp = choice(np.concatenate([*corner, [[0.1, 0.2, 1.0], [0.1, 0.0, 1.0]]]), tmp_path)
    assert sharp.tolerance == 0.0
    assert 0.01 <= sharp.corner_distance <= 0.02
    assert "straight lines with rounded corners" in sharp.reasons["corner_distance"]
