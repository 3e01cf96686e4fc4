"""Wrong robots, laws that do not suit them and impossible starts through the command line.

Status 2, one line on stderr that names the file, the thing, the value and what is allowed; nothing
is simulated.
"""

import os

import pytest

from pfsc_drake.robot.models.files import resolve_model

SIX = "pfc_elastic_6r"


def test_missing_model(refused, mine, tmp_path):
    refused(mine(), "'nope'", "comau_racer_1_4_elastic", changes=["robot.model=nope"])
    file = tmp_path / "nope.sdf"
    refused(mine(), "no such file", changes=["robot.model=nope.sdf"], file=file)


@pytest.mark.parametrize(
    "content", ["no robot", "<sdf version='1.9'><model name='x'>", "<robot name='x'/>"]
)
def test_unreadable_model(refused, mine, tmp_path, content):
    file = tmp_path / "arm.sdf"
    file.write_text(content, encoding="utf-8")
    refused(mine(), "robot.model", changes=["robot.model=arm.sdf"], file=file)


def test_no_such_tool_frame(refused, mine):
    parts = ("robot.tool_frame", "comau_racer_1_4_elastic_3r", "'gripper'")
    refused(mine(), *parts, changes=["robot.tool_frame=gripper"])


def test_a_tool_that_does_not_move(refused, mine):
    refused(mine(), "'base'", "no moving joint", changes=["robot.tool_frame=base"])


def test_a_joint_without_drive(refused, mine, tmp_path):
    text = resolve_model("comau_racer_1_4_elastic_3r").read_text(encoding="utf-8")
    lame = text.replace("<effort>900</effort>", "<effort>0</effort>")
    assert lame != text
    (tmp_path / "lame.sdf").write_text(lame, encoding="utf-8")
    refused(mine(), "robot.model", "actuator", changes=["robot.model=lame.sdf"])


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ("<mass>50.98077</mass>", "<mass>-1</mass>", ["link 'link_1'", "mass = -1"]),
        ("<mass>50.98077</mass>", "<mass></mass>", ["link 'link_1'", "mass = empty"]),
        ("<ixx>2.0392", "<ixx>9.0392", ["link 'link_1'", "principal moments"]),
        ("<spring_stiffness>", "<spring_stiffness>-", ["'flex_1'", "stiffness = -"]),
        ("<upper>", "<upper>-", ["'motor_1'", "lower, upper = -2.87979, -2.87979"]),
        ("<drake:gear_ratio>90", "<drake:gear_ratio>0", ["'motor_1'", "gear_ratio = 0"]),
        ("<drake:rotor_inertia>", "<drake:rotor_inertia>nan", ["'motor_1'", "rotor_inertia"]),
        ("</model>", "<include><uri>arm.sdf</uri></include></model>", ["includes itself"]),
    ],
)
def test_numbers_that_no_robot_has(refused, mine, tmp_path, old, new, parts):
    text = resolve_model("comau_racer_1_4_elastic_3r").read_text(encoding="utf-8")
    assert old in text
    file = tmp_path / "arm.sdf"
    file.write_text(text.replace(old, new, 1), encoding="utf-8")
    refused(
        mine(), "robot.model: ", *parts, "allowed: ", changes=["robot.model=arm.sdf"], file=file
    )


def test_files_that_are_no_files(refused, mine, tmp_path):
    os.mkfifo(tmp_path / "pipe.sdf")
    refused(mine(), "pipe.sdf", "regular file", changes=["robot.model=pipe.sdf"])
    (tmp_path / "folder.sdf").mkdir()
    refused(mine(), "folder.sdf", "regular file", changes=["robot.model=folder.sdf"])
    refused(mine(), "no such file", changes=[f"robot.model={'x' * 300}.sdf"])


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        ("robot.base=elbow", ["robot.base: 'elbow'"]),
        ("robot.base_pose={position: [0, 0]}", ["robot.base_pose", "position = [0.0, 0.0]"]),
        ("robot.base_pose.zyx=[0, 0, 0]", ["zyx", "zyx_deg"]),
        ("robot.gravity=[0, 0]", ["robot", "gravity = [0.0, 0.0]", "3 finite numbers"]),
        ("robot.gravity=9.81", ["robot.gravity", "9.81", "a list"]),
        ("robot.fixed_joints={elbow: 1}", ["robot.fixed_joints: 'elbow'", "motor_1, "]),
        ("robot.fixed_joints={flex_1: 0}", ["robot.fixed_joints: 'flex_1'", "spring"]),
        ("robot.packages={mine: nope}", ["robot.packages: mine", "no such folder"]),
        ("robot.elastic.stiffness=1e4", ["robot.elastic: ", "elastic already"]),
        ("robot.elastic.stiffness=soft", ["robot.elastic.stiffness[0]", "'soft'", "a number"]),
        ("robot.elastic.stiffness=-1", ["robot.elastic", "stiffness = [-1.0]", ".inf for a rigid"]),
        ("robot.elastic.gear_ratio=[1, 0]", ["robot.elastic", "gear_ratio = [1.0, 0.0]"]),
    ],
)
def test_keys_of_the_robot(refused, mine, change, parts):
    refused(mine(), *parts, changes=[change])


@pytest.mark.parametrize("law", ["elastic", "singular_perturbation"])
def test_law_for_elastic_joints_on_a_rigid_robot(refused, mine, law):
    changes = ["robot.model=comau_racer_1_4_3r", f"controller.law={law}"]
    refused(mine(), f"'{law}'", "elastic joints", "joint_1", changes=changes)


def test_as_many_outputs_as_joints(refused, mine):
    parts = ("6 joints", "3 outputs", "position only", "keyframes: [{angles_deg: [0, 0, 0]}]")
    refused(mine(SIX), *parts, changes=["path.orientation.keyframes=[]"])
    parts = ("3 joints", "6 outputs", "position and orientation")
    refused(mine(), *parts, changes=["path.orientation.keyframes=[{theta: 0}]"])


def test_more_outputs_than_joints_and_what_would_fit(refused, mine):
    changes = ["robot.model=comau_racer_1_4", "robot.fixed_joints={joint_6: 0}"]
    parts = ("5 joints for 6 outputs", "path.orientation.task: tool_axis", "none (position only)")
    refused(mine(SIX), *parts, changes=changes)
    refused(
        mine(), "task = tool_axis", "no orientation", changes=["path.orientation.task=tool_axis"]
    )


@pytest.mark.slow
def test_what_holds_back_needs_all_of_the_orientation(refused, mine):
    changes = ["hold_back.force=-10", "path.orientation.task=tool_axis"]
    refused(mine(SIX), "hold_back.force = -10", "all of its orientation", changes=changes)


@pytest.mark.slow
def test_a_servo_that_does_not_fit_the_controller(refused, mine):
    gains = "{eta: {poles: [-10]}, xi: {poles: [-10]}}"
    changes = ["controller.law=velocity_servo", f"controller.gains.velocity_servo={gains}"]
    parts = ("servo.period", "0.0003", "controller.sampling_time", "0.001")
    refused(mine(), *parts, changes=[*changes, "servo.period=0.0003"])
    parts = ("delay", "0.0015", "multiple of the period")
    refused(mine(), *parts, changes=[*changes, "servo.bus_delay=0.0015"])


def test_start_outside_the_feasible_neighbourhood(refused, mine):
    """60 mm inwards on a circle of 50 mm: e_cross points outwards."""
    changes = ["path.shape=!Circle {radius: 0.05}", "reference.points=[0, 0.1]"]
    parts = ("start.offset", "-0.06", "feasible neighbourhood", "alpha", "below 0.95")
    refused(mine(), *parts, changes=[*changes, "start.offset=[0, -0.06]"])


@pytest.mark.slow
def test_unreachable_start(refused, mine):
    changes = ["path.shape=!Line {start: [3, 0, 1], end: [3, 1, 1]}", "reference.points=[0, 0.5]"]
    refused(mine(), "start", "3.0", "unreachable", "the robot reaches 1.88", changes=changes)
    # with the tool pointing away from the robot the place is in reach, but not back towards it
    changes = [
        "path.shape=!Line {start: [1.3, 0, 1], end: [1.3, 0.6, 1]}",
        "reference.points=[0, 0.5]",
        "path.orientation.keyframes=[{angles_deg: [0, -90, 0]}]",
    ]
    refused(mine(SIX), "start", "pose", "unreachable", changes=changes)


@pytest.mark.parametrize("name", ["cell.dmd.yaml", "cell.yaml"])
def test_drakes_model_directives_are_no_delta_robot(refused, mine, tmp_path, name):
    file = tmp_path / name
    file.write_text("directives:\n- add_model: {name: arm, file: package://x/arm.sdf}\n")
    parts = ("Drake's model directives", "URDF, SDF or MJCF", "robot.base")
    refused(mine(), *parts, changes=[f"robot.model={name}"], file=file)
