"""Robots drawn from their frames."""

import numpy as np
import pytest
from pydrake.geometry import Box, Cylinder, Sphere
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from diagrams.drawing.model_meshes import stick_figure

INERTIAL = (
    '<inertial><mass value="1"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
)
# up, then 0.4 m sideways, then a slide along x with the tool 0.1 m on
ARM = f"""<robot name="arm">
<link name="base"/><link name="upper">{INERTIAL}</link><link name="slide">{INERTIAL}</link>
<link name="world"/>
<joint name="stand" type="fixed"><parent link="world"/><child link="base"/></joint>
<joint name="turn" type="revolute"><parent link="base"/><child link="upper"/>
  <origin xyz="0 0 0.3"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1"/></joint>
<joint name="move" type="prismatic"><parent link="upper"/><child link="slide"/>
  <origin xyz="0 0.4 0"/><axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="1"/></joint>
<frame name="tool" link="slide" xyz="0.1 0 0" rpy="0 0 1.5707963267948966"/>
</robot>"""


@pytest.fixture(scope="module")
def plant():
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(ARM, "urdf")
    plant.Finalize()
    return plant


@pytest.fixture(scope="module")
def parts(plant):
    return stick_figure(plant, plant.GetFrameByName("tool"))


def ends(part):
    """Both ends of a cylinder, axes of its body."""
    half = np.array([0.0, 0.0, part.form.length() / 2.0])
    return part.X_BP @ -half, part.X_BP @ half


def named(parts, beginning):
    return [part for part in parts if part.name.startswith(beginning)]


def test_sticks_lead_from_joint_to_joint_and_to_the_tool(parts):
    sticks = {part.body.name(): ends(part) for part in named(parts, "stick")}
    expected = {"base": [0, 0, 0.3], "upper": [0, 0.4, 0], "slide": [0.1, 0, 0]}
    assert sticks.keys() == expected.keys()
    for body, (begin, end) in sticks.items():
        np.testing.assert_allclose(begin, 0.0, atol=1e-12)
        np.testing.assert_allclose(end, expected[body], atol=1e-12)


def test_joints_lie_along_their_axes(parts):
    (turn,), (move,) = named(parts, "joint_turn"), named(parts, "joint_move")
    assert isinstance(turn.form, Cylinder) and turn.body.name() == "upper"
    np.testing.assert_allclose(turn.X_BP.rotation().col(2), [0, 1, 0], atol=1e-12)
    assert isinstance(move.form, Box) and move.body.name() == "slide"
    np.testing.assert_allclose(move.X_BP.rotation().col(2), [1, 0, 0], atol=1e-12)
    assert not named(parts, "joint_stand")


def test_tool_frame_has_three_axes(parts):
    x, y, z = named(parts, "tool_axis")
    length = 0.08 * 0.8  # of the sticks' 0.3 + 0.4 + 0.1 m
    origin = np.array([0.1, 0.0, 0.0])
    for axis, direction in ((x, [0, 1, 0]), (y, [-1, 0, 0]), (z, [0, 0, 1])):
        assert axis.body.name() == "slide"
        begin, end = ends(axis)
        np.testing.assert_allclose(begin, origin, atol=1e-12)
        np.testing.assert_allclose(end, origin + length * np.array(direction), atol=1e-12)


def test_names_are_unique_per_body(parts):
    names = [(part.body.name(), part.name) for part in parts]
    assert len(set(names)) == len(names)


def test_a_single_floating_body_is_a_point_with_axes():
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(
        f'<robot name="ball"><link name="ball">{INERTIAL}</link></robot>', "urdf"
    )
    plant.Finalize()
    parts = stick_figure(plant, plant.GetFrameByName("ball"))
    assert [type(part.form) for part in parts] == [Sphere, *3 * [Cylinder]]
