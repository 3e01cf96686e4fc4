"""A robot drawn from its frames alone: links as sticks, joints as short cylinders."""

import numpy as np
from pydrake.geometry import Box, Cylinder, Rgba, Shape, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    BodyIndex,
    Frame,
    Joint,
    JointIndex,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
)

from pfsc_drake.systems.drawing.robot_visualizer import BodyPart

_STICK_COLOR = Rgba(0.55, 0.58, 0.62)
_JOINT_COLOR = Rgba(0.95, 0.55, 0.1)
_AXIS_COLORS = (Rgba(0.85, 0.1, 0.1), Rgba(0.1, 0.65, 0.2), Rgba(0.1, 0.25, 0.9))
# of the robot's length: radii of sticks and joints, and the axes of the tool's frame
_STICK, _JOINT, _AXIS = 0.012, 0.022, 0.08
_SMALLEST = 1e-6  # of the robot's length, below which two points are one


def stick_figure(plant: MultibodyPlant, tool: Frame) -> list[BodyPart]:
    """Return the parts of a stick figure.

    Every body is drawn by sticks from the joint that carries it to the joints that it carries,
    and to the tool frame if that is its own; revolute joints as cylinders along their axes,
    prismatic ones as boxes, others as spheres; the tool frame as three axes (red x, green y,
    blue z). Thicknesses are in proportion to the robot's length.

    Args:
        plant: Plant with the robot, finalized.
        tool: The tool's frame.
    """
    joints = [plant.get_joint(JointIndex(i)) for i in plant.GetJointIndices()]
    bodies = [plant.get_body(BodyIndex(i)) for i in range(plant.num_bodies())]
    sticks = [stick for body in bodies for stick in _sticks(body, joints, tool)]
    length = sum(float(np.linalg.norm(end - begin)) for _, begin, end in sticks) or 1.0
    long = [stick for stick in sticks if np.linalg.norm(stick[2] - stick[1]) > _SMALLEST * length]
    parts = [
        _stick(body, f"stick_{i}", begin, end, _STICK * length, _STICK_COLOR)
        for i, (body, begin, end) in enumerate(long)
    ]
    parts += [_joint(joint, length) for joint in joints if joint.num_velocities() > 0]
    X_BT = tool.GetFixedPoseInBodyFrame()
    parts += [
        _stick(
            tool.body(),
            f"tool_axis_{i}",
            X_BT.translation(),
            X_BT @ (_AXIS * length * np.eye(3)[i]),
            0.3 * _STICK * length,
            color,
        )
        for i, color in enumerate(_AXIS_COLORS)
    ]
    return parts


def _sticks(
    body: RigidBody, joints: list[Joint], tool: Frame
) -> list[tuple[RigidBody, np.ndarray, np.ndarray]]:
    """Begin and end of each stick of a body, axes of the body [m]."""
    carried_by = [joint for joint in joints if joint.child_body() is body]
    begin = _origin(carried_by[0].frame_on_child()) if carried_by else np.zeros(3)
    ends = [_origin(j.frame_on_parent()) for j in joints if j.parent_body() is body]
    if tool.body() is body:
        ends.append(_origin(tool))
    return [(body, begin, end) for end in ends]


def _origin(frame: Frame) -> np.ndarray:
    """Origin of a frame in its body's [m], shape (3,)."""
    return frame.GetFixedPoseInBodyFrame().translation()


def _stick(
    body: RigidBody, name: str, begin: np.ndarray, end: np.ndarray, radius: float, color: Rgba
) -> BodyPart:
    """A cylinder between two points of a body."""
    direction = end - begin
    R_BP = RotationMatrix.MakeFromOneVector(direction, 2)
    X_BP = RigidTransform(R_BP, (begin + end) / 2.0)
    return BodyPart(body, name, Cylinder(radius, float(np.linalg.norm(direction))), X_BP, color)


def _joint(joint: Joint, length: float) -> BodyPart:
    """A joint, drawn with the body that it carries."""
    X_BF = joint.frame_on_child().GetFixedPoseInBodyFrame()
    size = _JOINT * length
    form: Shape = Sphere(size)
    axis = np.array([0.0, 0.0, 1.0])
    if isinstance(joint, RevoluteJoint):
        axis, form = joint.revolute_axis(), Cylinder(size, 3.0 * size)
    elif isinstance(joint, PrismaticJoint):
        axis, form = joint.translation_axis(), Box(1.6 * size, 1.6 * size, 3.0 * size)
    X_FP = RigidTransform(RotationMatrix.MakeFromOneVector(axis, 2))
    return BodyPart(joint.child_body(), f"joint_{joint.name()}", form, X_BF @ X_FP, _JOINT_COLOR)
