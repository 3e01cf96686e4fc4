"""Joints of a parsed plant: their order, drives, and removal."""

from dataclasses import dataclass

import numpy as np
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    BodyIndex,
    ForceElement,
    ForceElementIndex,
    Frame,
    FrameIndex,
    Joint,
    JointActuator,
    JointIndex,
    PrismaticJoint,
    PrismaticSpring,
    RevoluteJoint,
    RevoluteSpring,
    RigidBody,
    WeldJoint,
)

from pfsc_drake.errors import InputError


def bodies_of(plant: MultibodyPlant) -> list[RigidBody]:
    """Return the bodies of a plant, the world first."""
    return [plant.get_body(BodyIndex(i)) for i in range(plant.num_bodies())]


def frame_named(plant: MultibodyPlant, name: str) -> Frame | None:
    """Return the link or frame of a name, or None if there is none.

    Args:
        plant: A plant.
        name: Its name, with as many of the models around it as are needed (``sub::tcp``).

    Raises:
        InputError: If several have that name.
    """
    frames = [plant.get_frame(FrameIndex(i)) for i in range(plant.num_frames())]
    found = {
        frame.scoped_name().get_full(): frame
        for frame in frames
        if f"::{frame.scoped_name().get_full()}".endswith(f"::{name}")
    }
    if len(found) > 1 and name not in found:
        raise InputError(f"'{name}' names several frames; allowed: {', '.join(found)}")
    return found.get(name) or next(iter(found.values()), None)


def all_joints(plant: MultibodyPlant) -> list[Joint]:
    """Return the joints of a plant by their index, those that cannot move as well."""
    return [plant.get_joint(JointIndex(i)) for i in plant.GetJointIndices()]


def model_frames(plant: MultibodyPlant) -> list[Frame]:
    """Return the named frames of a plant, without the world's and those that Drake adds at joints.

    Args:
        plant: A plant.
    """
    added = {f"{j.name()}_{end}" for j in all_joints(plant) for end in ("parent", "child", "base")}
    frames = [plant.get_frame(FrameIndex(i)) for i in range(1, plant.num_frames())]
    return [frame for frame in frames if frame.name() and frame.name() not in added]


def force_elements(plant: MultibodyPlant) -> list[ForceElement]:
    """Return gravity, springs and all other force elements of a plant."""
    return [
        plant.get_force_element(ForceElementIndex(i)) for i in range(plant.num_force_elements())
    ]


def joints_of(plant: MultibodyPlant) -> list[Joint]:
    """Return the joints of a plant, base first, then by their index."""
    joints = all_joints(plant)
    inboard = inboard_joints(plant)

    def depth(joint: Joint) -> int:
        steps = 0
        below = inboard.get(joint.parent_body().index())
        while below is not None and steps <= len(joints):
            steps, below = steps + 1, inboard.get(below.parent_body().index())
        return steps

    return sorted(joints, key=depth)


def inboard_joints(plant: MultibodyPlant) -> dict[BodyIndex, Joint]:
    """Return the joint that carries each body, by the body's index."""
    return {joint.child_body().index(): joint for joint in all_joints(plant)}


def moving_joints(plant: MultibodyPlant) -> list[Joint]:
    """Return the joints that are no welds, base first."""
    return [joint for joint in joints_of(plant) if not isinstance(joint, WeldJoint)]


def sprung_joints(plant: MultibodyPlant) -> list[Joint]:
    """Return the joints that carry a spring, base first."""
    sprung = {
        element.joint().index()
        for element in force_elements(plant)
        if isinstance(element, RevoluteSpring | PrismaticSpring)
    }
    return [joint for joint in joints_of(plant) if joint.index() in sprung]


def drivable_joints(plant: MultibodyPlant) -> list[Joint]:
    """Return the joints that actuators can move: revolute or prismatic, no spring, base first.

    Joints with a spring are driven by the motor joint in front of them.
    """
    sprung = {joint.index() for joint in sprung_joints(plant)}
    return [
        joint
        for joint in moving_joints(plant)
        if isinstance(joint, RevoluteJoint | PrismaticJoint) and joint.index() not in sprung
    ]


def actuator_of(plant: MultibodyPlant, joint: Joint) -> JointActuator | None:
    """Return the actuator of a joint, if it has one."""
    for index in plant.GetJointActuatorIndices():
        actuator = plant.get_joint_actuator(index)
        if actuator.joint().index() == joint.index():
            return actuator
    return None


def idealize_drives(plant: MultibodyPlant) -> None:
    """Make the joints of an arm without masses integrators: unit inertia, no damping.

    Servos are designed for the inertia at the drives, so that its value changes no motion.

    Args:
        plant: The plant, not finalized, with an actuator at every joint that moves.
    """
    for joint in drivable_joints(plant):
        actuator = actuator_of(plant, joint)
        assert actuator is not None
        actuator.set_default_rotor_inertia(1.0)
        actuator.set_default_gear_ratio(1.0)
        joint.set_default_damping(0.0)


def pose_at(joint: Joint, value: float) -> RigidTransform:
    """Return the pose of a joint's moving frame in its fixed frame.

    Args:
        joint: A revolute or prismatic joint.
        value: Its position [rad or m].
    """
    if isinstance(joint, RevoluteJoint):
        return RigidTransform(RotationMatrix(AngleAxis(value, joint.revolute_axis())), np.zeros(3))
    return RigidTransform(value * joint.translation_axis())


@dataclass(frozen=True)
class JointRecord:
    """Parameters of a revolute or prismatic joint removed from a plant, and of its drive.

    Attributes:
        kind: Its class.
        name: Its name.
        axis: Unit vector of its axis in both frames, shape (3,).
        frame_on_parent: Its fixed frame F.
        frame_on_child: Its moving frame M.
        damping: Viscous damping [Nm s/rad or N s/m].
        limits: Lower and upper limits of position, velocity and acceleration.
        drive: Name, effort limit, rotor inertia and gear ratio of its actuator, if it has one.
    """

    kind: type[Joint]
    name: str
    axis: np.ndarray
    frame_on_parent: Frame
    frame_on_child: Frame
    damping: float
    limits: tuple[tuple[np.ndarray, np.ndarray], ...]
    drive: tuple[str, float, float, float] | None

    def add_to(
        self, plant: MultibodyPlant, frame_on_parent: Frame, frame_on_child: Frame
    ) -> tuple[Joint, JointActuator | None]:
        """Add the joint, with its drive, between other frames."""
        joint = plant.AddJoint(
            self.kind(self.name, frame_on_parent, frame_on_child, self.axis, damping=self.damping)
        )
        positions, velocities, accelerations = self.limits
        joint.set_position_limits(*positions)
        joint.set_velocity_limits(*velocities)
        joint.set_acceleration_limits(*accelerations)
        if self.drive is None:
            return joint, None
        name, effort_limit, rotor_inertia, gear_ratio = self.drive
        actuator = plant.AddJointActuator(name, joint, effort_limit)
        actuator.set_default_rotor_inertia(rotor_inertia)
        actuator.set_default_gear_ratio(gear_ratio)
        return joint, actuator


def remove_joint(plant: MultibodyPlant, joint: Joint) -> JointRecord:
    """Remove a revolute or prismatic joint without spring from a plant, with its drive."""
    actuator = actuator_of(plant, joint)
    revolute = isinstance(joint, RevoluteJoint)
    record = JointRecord(
        RevoluteJoint if revolute else PrismaticJoint,
        joint.name(),
        np.array(joint.revolute_axis() if revolute else joint.translation_axis()),
        joint.frame_on_parent(),
        joint.frame_on_child(),
        float(joint.default_damping_vector()[0]),
        (
            (joint.position_lower_limits(), joint.position_upper_limits()),
            (joint.velocity_lower_limits(), joint.velocity_upper_limits()),
            (joint.acceleration_lower_limits(), joint.acceleration_upper_limits()),
        ),
        None
        if actuator is None
        else (
            actuator.name(),
            actuator.effort_limit(),
            actuator.default_rotor_inertia(),
            actuator.default_gear_ratio(),
        ),
    )
    if actuator is not None:
        plant.RemoveJointActuator(actuator)
    plant.RemoveJoint(joint)
    return record
