"""Robots of bare model files: a crane with a gripper, askew on a slanted base."""

from pathlib import Path

import numpy as np
import pytest

from diagrams.robots.model import read_robot
from identification.consistency.writing import write_model
from identification.model.base import random_motion
from identification.model.dynamic_parameters import true_parameters
from identification.model.regressor import Regressor
from identification.model.subject import load_subject
from pfsc_drake.errors import InputError

CRANE = """<robot name="crane">
  <link name="foot"/>
  <link name="tower"><inertial><origin xyz="0.1 0 0.3" rpy="0 0 0"/><mass value="10"/>
    <inertia ixx="1" iyy="1.2" izz="0.8" ixy="0.1" ixz="0" iyz="0"/></inertial></link>
  <link name="arm"><inertial><origin xyz="0.5 0 0" rpy="0.1 0.2 0.3"/><mass value="4"/>
    <inertia ixx="0.2" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="hook"><inertial><origin xyz="0 0 -0.2" rpy="0 0 0"/><mass value="2"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="swing" type="continuous"><parent link="foot"/><child link="tower"/>
    <origin xyz="0 0 0.2" rpy="0.1 0 0"/><axis xyz="0 0.6 0.8"/>
    <limit effort="100" velocity="2"/></joint>
  <joint name="out" type="prismatic"><parent link="tower"/><child link="arm"/>
    <origin xyz="0 0.1 1" rpy="0 0.3 0.2"/><axis xyz="1 0 0"/>
    <limit effort="200" velocity="1" lower="0" upper="2"/></joint>
  <joint name="nod" type="revolute"><parent link="arm"/><child link="hook"/>
    <origin xyz="1 0 0" rpy="0 0 0.5"/><axis xyz="0 1 0"/>
    <limit effort="50" velocity="3" lower="-1" upper="1.5"/></joint>
  <link name="finger"><inertial><origin xyz="0 0.1 0" rpy="0 0 0"/><mass value="0.3"/>
    <inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="grip" type="prismatic"><parent link="hook"/><child link="finger"/>
    <origin xyz="0 0 -0.4" rpy="0.2 0 0"/><axis xyz="0 1 0"/>
    <limit effort="10" velocity="1" lower="0" upper="0.1"/></joint>
</robot>
"""
SDF = """<sdf version="1.9"><model name="arm">
  <link name="base"><inertial><mass>1</mass></inertial></link>
  <joint name="weld" type="fixed"><parent>world</parent><child>base</child></joint>
  <link name="one"><pose>0 0 0.5 0 0.3 0</pose><inertial><pose>0.1 0 0 0.4 0 0</pose><mass>3</mass>
    <inertia><ixx>0.1</ixx><iyy>0.1</iyy><izz>0.1</izz></inertia></inertial></link>
  <joint name="a" type="revolute"><parent>base</parent><child>one</child>
    <pose>0 0.1 0 0.2 0 0</pose><axis><xyz>0 0 1</xyz></axis></joint>
  <link name="two"><pose>0.5 0 0.5 0 0 0.1</pose><inertial><pose>0.2 0 0.1 0 0 0</pose>
    <mass>2</mass><inertia><ixx>0.05</ixx><iyy>0.05</iyy><izz>0.05</izz></inertia></inertial></link>
  <joint name="b" type="revolute"><parent>one</parent><child>two</child>
    <axis><xyz>0 1 0</xyz></axis></joint>
</model></sdf>
"""


def load(folder, model, gripper=True, tool="hook"):
    """Return the robot as a scenario would have it."""
    fixed = ", fixed_joints: {grip: 0.05}" if gripper else ""
    scenario = folder / f"{Path(model).stem}_scenario.yaml"
    scenario.write_text(
        f"robot: {{model: {model}, tool_frame: {tool}{fixed}, "
        "base_pose: {position: [0.1, 0.2, 0.3], zyx_deg: [10, 20, 30]}}\n"
    )
    return load_subject(scenario)


def identified(subject, seed=0):
    random, n = np.random.default_rng(seed), subject.dimension
    own = true_parameters(subject, friction=False)
    own[10 * n :] = random.uniform(0.05, 0.2, n)
    scaled = own * np.concatenate([np.repeat(random.uniform(0.9, 1.3, n), 10), np.ones(n)])
    return np.concatenate([scaled, random.uniform(1.0, 2.0, 2 * n)])


def same(one, other, parameters):
    np.testing.assert_allclose(
        true_parameters(other, friction=False), parameters[: -2 * one.dimension], atol=1e-12
    )
    assert other.joint_names == one.joint_names
    np.testing.assert_allclose(other.position_limits, one.position_limits)
    matrices = [Regressor(subject, friction=False).matrix for subject in (one, other)]
    motion = random_motion(Regressor(one, friction=False))
    np.testing.assert_allclose(*(matrix(*motion) for matrix in matrices), atol=1e-9)
    np.testing.assert_allclose(other.chain.p_LT, one.chain.p_LT, atol=1e-12)


def test_urdf_keeps_its_names_and_its_gripper(tmp_path):
    file = tmp_path / "crane.urdf"
    file.write_text(CRANE)
    subject = load(tmp_path, file)
    parameters = identified(subject)
    written = write_model(subject, parameters, tmp_path / "out")
    assert written.files == [tmp_path / "out" / "crane.urdf"] and not written.notes
    same(subject, load(tmp_path, written.urdf), parameters)
    plant, _ = read_robot(load(tmp_path, written.urdf).block, Path())
    assert plant.GetBodyByName("finger").default_mass() == 0.3


@pytest.mark.parametrize("rotor", ["", "<drake:rotor_inertia>0.1</drake:rotor_inertia>"])
def test_sdf(tmp_path, rotor):
    file = tmp_path / "arm.sdf"
    file.write_text(SDF.replace("</axis></joint>", f"</axis>{rotor}</joint>", 1))
    subject = load(tmp_path, file, gripper=False, tool="two")
    parameters = identified(subject)
    written = write_model(subject, parameters, tmp_path / "out")
    assert [file.name for file in written.files] == ["arm.sdf", "arm.urdf"]
    for model in written.files:
        same(subject, load(tmp_path, model, gripper=False, tool="two"), parameters)


@pytest.mark.parametrize(
    "actuator",
    [
        '<actuator name="drive"/>',
        '<actuator name="drive"></actuator>',
        '<actuator name="drive"><drake:rotor_inertia value="0.3"/></actuator>',
    ],
)
def test_drives_of_a_urdf(tmp_path, actuator):
    transmission = (
        '<transmission name="t"><type>transmission_interface/SimpleTransmission</type>'
        f'<joint name="out"/>{actuator}</transmission></robot>'
    )
    file = tmp_path / "crane.urdf"
    file.write_text(CRANE.replace("</robot>", transmission))
    subject = load(tmp_path, file)
    parameters = identified(subject)
    written = write_model(subject, parameters, tmp_path / "out")
    same(subject, load(tmp_path, written.urdf), parameters)


def test_a_gripper_that_weighs_too_much_is_left_out(tmp_path):
    """Then only links and joints are written, and why is said."""
    file = tmp_path / "crane.urdf"
    file.write_text(CRANE.replace('mass value="0.3"', 'mass value="1.9"'))
    subject = load(tmp_path, file)
    parameters = identified(subject)
    parameters[20:30] *= 0.4
    written = write_model(subject, parameters, tmp_path / "out")
    (note,) = written.notes
    assert "links and joints alone are written: " in note
    assert "link 'hook' beside finger: principal moments" in note
    text = written.urdf.read_text()
    assert "finger" not in text and 'name="hook"' in text
    other = load(tmp_path, written.urdf, gripper=False)
    assert other.joint_names == ["swing", "out", "nod"]


def test_own_model_is_not_replaced(tmp_path):
    file = tmp_path / "crane.urdf"
    file.write_text(CRANE)
    subject = load(tmp_path, file)
    with pytest.raises(InputError, match=r"holds the robot's own model crane.urdf"):
        write_model(subject, identified(subject), tmp_path)
