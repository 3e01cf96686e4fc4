"""Where a model stands, and joints that do not move, against the model's own kinematics."""

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw

from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.models.joint_edits import frame_named
from pfsc_drake.robot.robot_model import pose_function
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant

X_WB = RigidTransform(RollPitchYaw(0.3, -1.1, 2.0), [0.4, -0.2, 1.5])
LIMITED = '<limit lower="-0.5" upper="0.5" effort="100" velocity="1"/>'


def pose(plant, frame, q):
    """Return a frame's pose at joint positions by name."""
    context = plant.CreateDefaultContext()
    positions = plant.GetPositions(context)
    for name, value in q.items():
        positions[plant.GetJointByName(name).position_start()] = value
    plant.SetPositions(context, positions)
    return plant.GetFrameByName(frame).CalcPoseInWorld(context)


def same(one, other):
    np.testing.assert_allclose(one.GetAsMatrix4(), other.GetAsMatrix4(), atol=1e-12)


Q = {"shoulder": 0.7, "elbow": -0.4}


def test_the_root_link_is_the_base_of_a_floating_model(write, read, urdf_text):
    file = write(urdf_text)
    plain, placed = read(file)[0], read(file, base_pose=X_WB)[0]
    same(pose(placed, "base_link", Q), X_WB)
    same(pose(placed, "tcp", Q), X_WB @ pose(plain, "tcp", Q))


@pytest.mark.parametrize("pose_of_base", [RigidTransform(), X_WB])
def test_any_frame_on_the_first_link_can_be_the_base(write, read, urdf_parts, pose_of_base):
    """As UR robots have it: 'base' is turned against 'base_link'."""
    urdf, link, joint = urdf_parts
    turned = joint("turn", "base_link", "base", '<origin rpy="0.2 0 3" xyz="0 0.1 0"/>', "fixed")
    turned = turned.replace('<origin xyz="0 0 0.3"/>', "")
    file = write(urdf(link("base", ""), turned))
    plain, placed = read(file)[0], read(file, base="base", base_pose=pose_of_base)[0]
    same(pose(placed, "base", Q), pose_of_base)
    for frame in ("base_link", "tcp"):
        in_base = pose(plain, "base", Q).inverse() @ pose(plain, frame, Q)
        same(pose(placed, frame, Q), pose_of_base @ in_base)


def test_a_model_that_is_attached_to_the_world(write, read, sdf_text):
    raised = sdf_text.replace("<child>base<", "<pose>0 0 0 0 0 0</pose><child>base<")
    raised = raised.replace('<link name="base">', '<link name="base"><pose>1 2 3 0.1 0 0</pose>')
    file = write(raised, "arm.sdf")
    plain = read(file)[0]
    assert np.linalg.norm(pose(plain, "base", {}).translation()) > 1.0
    q = {"shoulder": 0.6}
    placed = read(file, base_pose=X_WB)[0]
    same(pose(placed, "arm", q), X_WB @ pose(plain, "arm", q))
    placed = read(file, base="base", base_pose=X_WB)[0]
    same(pose(placed, "base", q), X_WB)


def test_a_gantry_on_the_ceiling(write, read, urdf_parts):
    """Its first joint moves against the link 'world', which is Drake's world."""
    urdf, _, joint = urdf_parts
    rail = joint("rail", "world", "base_link", LIMITED, "prismatic", axis="1 0 0")
    text = urdf('<link name="world"/>', rail)
    mass = '<inertial><mass value="5"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    file = write(text.replace('"base_link">', f'"base_link">{mass}</inertial>', 1))
    q = Q | {"rail": 0.25}
    plain, placed = read(file)[0], read(file, base_pose=X_WB)[0]
    same(pose(placed, "tcp", q), X_WB @ pose(plain, "tcp", q))
    for attribute in ("effort_limit", "position_limits", "velocity_limit"):
        values = [
            chain_from_plant(p, p.GetFrameByName("tcp"))[0].gather(attribute)
            for p in (plain, placed)
        ]
        np.testing.assert_array_equal(*values)
    assert values[0].tolist() == [1.0, 1.5, 1.5]


def test_bases_that_are_none(write, read, refused, urdf_text):
    file = write(urdf_text)
    refused(lambda: read(file, base="nope"), "base: 'nope'", "allowed", "as base_link, ")
    refused(lambda: read(file, base="tcp"), "base: 'tcp' moves with joint 'elbow'", "allowed")


def test_gravity(write, read, urdf_text):
    file = write(urdf_text)
    on_the_wall = RigidTransform(RollPitchYaw(0.0, np.pi / 2, 0.0), np.zeros(3))
    turned = read(file, base_pose=on_the_wall)[0]
    # standing upright with gravity in -x of its base, the arm feels the same
    tilted = read(file, gravity=np.array([9.81, 0.0, 0.0]))[0]
    torques = []
    for plant in (turned, tilted):
        context = plant.CreateDefaultContext()
        plant.SetPositions(context, [0.3, 0.8])
        torques.append(plant.CalcGravityGeneralizedForces(context))
    np.testing.assert_allclose(*torques, atol=1e-12)
    assert np.abs(torques[0]).max() > 1.0


def test_fixed_joints_are_links(write, read, urdf_parts):
    urdf, link, joint = urdf_parts
    slide = joint("lift", "tcp", "plate", LIMITED, "prismatic", axis="0 0.6 0.8")
    file = write(urdf(link("plate"), slide))
    free = read(file)[0]
    plant = read(file, fixed_joints={"elbow": 0.9, "lift": -0.2})[0]
    assert plant.num_positions() == plant.num_actuators() == 1
    for angle in (0.0, 1.3):
        expected = pose(free, "plate", {"shoulder": angle, "elbow": 0.9, "lift": -0.2})
        same(pose(plant, "plate", {"shoulder": angle}), expected)


@pytest.mark.parametrize(
    ("fixed", "parts"),
    [
        ({"wrist": 0.0}, ["fixed_joints: 'wrist'", "shoulder, elbow"]),
        ({"flange": 0.0}, ["fixed_joints: 'flange'", "shoulder, elbow"]),
        ({"elbow": 90.0}, ["elbow = 90 rad", "-2 to 2 rad"]),
    ],
)
def test_joints_that_cannot_be_fixed(write, read, refused, urdf_text, fixed, parts):
    file = write(urdf_text)
    refused(lambda: read(file, fixed_joints=fixed), *parts)


def test_an_elastic_model_on_the_ceiling(read, refused):
    """Its springs are put back where they were, and it is held where gravity pulls it."""
    file = resolve_model("comau_racer_1_4_elastic_3r")
    down = RigidTransform(RollPitchYaw(np.pi, 0.0, 0.0), [0.0, 0.0, 2.0])
    (plain, _), (hanging, _) = (
        chain_from_plant(plant, plant.GetFrameByName("tool_point"))
        for plant in (read(file)[0], read(file, base_pose=down)[0])
    )
    assert hanging.is_elastic
    for attribute in ("stiffness", "damping", "reflected_inertia", "mass", "effort_limit"):
        np.testing.assert_array_equal(hanging.gather(attribute), plain.gather(attribute))
    q = np.array([0.2, 1.0, -0.5])
    foot, shoulder = (np.array(pose_function(chain)(q)).ravel()[:3] for chain in (plain, hanging))
    np.testing.assert_allclose(shoulder, down @ foot, atol=1e-12)
    refused(lambda: read(file, fixed_joints={"flex_1": 0.0}), "'flex_1'", "spring")


def test_frames_of_models_within_models(write, read, refused, sdf_text):
    inertial = sdf_text[sdf_text.index("<inertial>") : sdf_text.index("</link>")]
    inner = (
        f'<model name="sub"><link name="base">{inertial}</link></model>'
        '<joint name="w" type="fixed"><parent>arm</parent><child>sub::base</child></joint></model>'
    )
    file = write(sdf_text.replace("</model>", inner), "arm.sdf")
    refused(lambda: read(file, base="base"), "base: 'base' names several", "arm::sub::base")
    plant, _ = read(file, base="arm::base", base_pose=X_WB)
    same(frame_named(plant, "arm::base").CalcPoseInWorld(plant.CreateDefaultContext()), X_WB)
    assert frame_named(plant, "sub::base").body().name() == "base"
    assert frame_named(plant, "nothing") is None
