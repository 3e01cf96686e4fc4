"""A first scenario for a robot and points of a user's own: what is chosen, said, refused."""

import csv

import numpy as np
import pytest
import yaml

from experiments.cli import main

AXES = ["0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0"]
ORIGINS = ["0 0 0.4", "0.1 0 0", "0 0 0.5", "0.3 0 0.1", "0.2 0 0", "0.1 0 0"]
INERTIAL = (
    '<inertial><origin xyz="0.05 0 0.02"/><mass value="{}"/><inertia ixx="0.02" iyy="0.03" '
    'izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial>'
)
GRIPPER = """
<link name="hand">{mass}</link><joint name="mount" type="fixed"><parent link="l6"/>
<child link="hand"/><origin xyz="0.05 0 0"/></joint>
<joint name="finger_1" type="prismatic"><parent link="hand"/><child link="f1"/><axis xyz="0 1 0"/>
<limit lower="0.01" upper="0.04" effort="20" velocity="1"/></joint><link name="f1">{mass}</link>
<joint name="finger_2" type="prismatic"><parent link="hand"/><child link="f2"/><axis xyz="0 -1 0"/>
<limit lower="0" upper="0.04" effort="20" velocity="1"/>
<mimic joint="finger_1" multiplier="0.5"/></joint><link name="f2">{mass}</link>
<joint name="point" type="fixed"><parent link="hand"/><child link="my_tcp"/><origin xyz="0.1 0 0"/>
</joint><link name="my_tcp"/>"""


LINK = INERTIAL.format(1.3)


def arm(joints=6, inertial=LINK, more=""):
    """Return a URDF: an arm, and what else there is on its last link."""
    parts = ['<robot name="mine"><link name="base"/>']
    for i in range(joints):
        parent = f"l{i}" if i else "base"
        parts.append(
            f'<joint name="j{i + 1}" type="revolute"><parent link="{parent}"/>'
            f'<child link="l{i + 1}"/><origin xyz="{ORIGINS[i]}"/><axis xyz="{AXES[i]}"/>'
            '<limit lower="-2.8" upper="2.8" effort="230" velocity="3"/></joint>'
            f'<link name="l{i + 1}">{inertial}</link>'
        )
    return "".join(parts) + more + "</robot>"


TOOL = (
    '<joint name="t" type="fixed"><parent link="l6"/><child link="tool0"/></joint>'
    '<link name="tool0"/>'
)


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


def arc(count=9, scale=1.0, offset=(0.7, 0.0, 0.6)):
    """Return points on an arc of 0.1 m radius."""
    angle = np.linspace(0.2, 1.7, count)
    ring = np.stack([0.1 * np.cos(angle), 0.1 * np.sin(angle), 0.02 * angle], axis=1)
    return scale * (ring + offset)


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
    # the gripper points along the x axis of its frame: down, where z points forward
    assert data["path"]["orientation"]["keyframes"] == [{"angles_deg": [0.0, 90.0, 0.0]}]
    assert "z axis forward" in out
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
        (arc(), ("--base-position", "1,2"), "--base-position 1,2: allowed: X,Y,Z in m"),
        (arc(), ("--law", "elastic"), "elastic"),
        (arc(), ("--law", "rigit"), "rigid"),
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
