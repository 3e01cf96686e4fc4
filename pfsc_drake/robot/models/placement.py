"""Placement of a parsed model in the world, and fixing of its joints."""

from collections.abc import Mapping

from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    Frame,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    WeldJoint,
)

from pfsc_drake.errors import InputError, suggestion
from pfsc_drake.robot.models.joint_edits import (
    bodies_of,
    frame_named,
    inboard_joints,
    joints_of,
    moving_joints,
    pose_at,
    remove_joint,
)

# of a model in messages
_MOST_NAMES = 6


def fix_joints(plant: MultibodyPlant, values: Mapping[str, float]) -> None:
    """Weld joints at fixed positions.

    Args:
        plant: A plant that is not finalized, without springs.
        values: Positions by joint name [rad or m].

    Raises:
        InputError: If there is no such joint, or the value is beyond its limits.
    """
    for name, value in values.items():
        movable = {
            joint.name(): joint
            for joint in moving_joints(plant)
            if isinstance(joint, RevoluteJoint | PrismaticJoint)
        }
        if name not in movable:
            allowed = ", ".join(movable) or "none, nothing moves"
            nearest = suggestion(name, movable)
            raise InputError(f"fixed_joints: '{name}'; allowed: {allowed}{nearest}")
        joint = movable[name]
        lower, upper = joint.position_lower_limits()[0], joint.position_upper_limits()[0]
        if not lower <= value <= upper:
            unit = "rad" if isinstance(joint, RevoluteJoint) else "m"
            raise InputError(
                f"fixed_joints: {name} = {value:g} {unit}; allowed: {lower:g} to {upper:g} {unit}"
            )
        X_FM = pose_at(joint, value)
        record = remove_joint(plant, joint)
        plant.AddJoint(WeldJoint(name, record.frame_on_parent, record.frame_on_child, X_FM))


def weld_base(plant: MultibodyPlant, base: str, X_WB: RigidTransform) -> None:
    """Weld a model's base to the world.

    Args:
        plant: A plant that is not finalized, without springs.
        base: Frame B of the model; if empty the root link of a model that floats, or the world
            frame of a model that is attached to the world.
        X_WB: Pose of B in the world.

    Raises:
        InputError: If there is no such frame, it moves, or bodies hang on nothing.
    """
    inboard, world = inboard_joints(plant), plant.world_body()
    roots = [b for b in bodies_of(plant)[1:] if b.index() not in inboard]
    attached = [joint for joint in joints_of(plant) if joint.parent_body().index() == world.index()]
    frame = _base_frame(plant, base, world if attached or not roots else roots[0])
    root, X_RB = _root_of(plant, frame)
    loose = [f"'{body.name()}'" for body in roots if body.index() != root.index()]
    if loose:
        raise InputError(
            f"base: '{root.name()}' carries not all; {', '.join(loose)} hang on nothing; "
            "allowed: one robot, without loose bodies"
        )
    X_WR = X_WB @ X_RB.inverse()
    if root.index() != world.index():
        plant.WeldFrames(plant.world_frame(), root.body_frame(), X_WR)
    elif not X_WR.IsExactlyIdentity():
        for joint in attached:
            X_WF = X_WR @ joint.frame_on_parent().GetFixedPoseInBodyFrame()
            name = f"{joint.name()}_base"
            moved = plant.AddFrame(FixedOffsetFrame(name, plant.world_frame(), X_WF))
            if isinstance(joint, WeldJoint):
                arguments = joint.name(), joint.frame_on_child(), joint.X_FM()
                plant.RemoveJoint(joint)
                plant.AddJoint(WeldJoint(arguments[0], moved, *arguments[1:]))
            else:
                record = remove_joint(plant, joint)
                record.add_to(plant, moved, record.frame_on_child)


def _base_frame(plant: MultibodyPlant, base: str, default: RigidBody) -> Frame:
    if not base:
        return default.body_frame()
    try:
        frame = frame_named(plant, base)
    except InputError as error:
        raise InputError(f"base: {error}") from None
    if frame is None:
        names = [body.name() for body in bodies_of(plant)[1 : 1 + _MOST_NAMES]]
        raise InputError(
            f"base: '{base}'; allowed: a link or frame of the model, as {', '.join(names)}"
        )
    return frame


def _root_of(plant: MultibodyPlant, frame: Frame) -> tuple[RigidBody, RigidTransform]:
    """Return the root body that a frame is welded to, and the frame's pose in it."""
    inboard = inboard_joints(plant)
    body, X_BF = frame.body(), frame.GetFixedPoseInBodyFrame()
    while body.index() in inboard:
        joint = inboard[body.index()]
        if not isinstance(joint, WeldJoint):
            raise InputError(
                f"base: '{frame.name()}' moves with joint '{joint.name()}'; allowed: a frame "
                "fixed to the first link"
            )
        X_PF = joint.frame_on_parent().GetFixedPoseInBodyFrame()
        X_CM = joint.frame_on_child().GetFixedPoseInBodyFrame()
        X_BF = X_PF @ joint.X_FM() @ X_CM.inverse() @ X_BF
        body = joint.parent_body()
    return body, X_BF
