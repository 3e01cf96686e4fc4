"""The DELTA robot as bodies, joints and constraints of a MultibodyPlant, for contact."""

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import DiscreteContactSolver, MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    JointActuatorIndex,
    ModelInstanceIndex,
    PrismaticJoint,
    RigidBody,
    SpatialInertia,
)
from pydrake.systems.framework import Context

from pfsc_drake.errors import InputError
from pfsc_drake.robot.delta.delta_parameters import DeltaParameters
from pfsc_drake.robot.delta.delta_robot import DeltaRobot
from pfsc_drake.robot.delta.shapes import BASE, PLATE, robot_parts, slide_origins

# radius of the ball whose inertia replaces each body's; no body turns, so that it has no effect
_BODY_RADIUS = 0.05


@dataclass(frozen=True)
class DeltaModel:
    """A DELTA robot in a plant.

    Attributes:
        robot: The robot that was added.
        model_instance: Its model instance.
        slides: Joints of the slides, q_i [m], three.
        cartesian: Joints of the end-effector along x_0, y_0, z_0 [m], three.
        actuators: Indices of the drives in the plant, three.
        end_effector: Body of plate, load and share of the rods; its origin is E and its axes
            are the inertial frame's.
    """

    robot: DeltaRobot
    model_instance: ModelInstanceIndex
    slides: tuple[PrismaticJoint, ...]
    cartesian: tuple[PrismaticJoint, ...]
    actuators: tuple[JointActuatorIndex, ...]
    end_effector: RigidBody


def add_delta_plant(
    plant: MultibodyPlant,
    parameters: DeltaParameters,
    visual: bool = False,
    with_load: bool = True,
) -> DeltaModel:
    """Add a DELTA robot to a plant: (2.71) with the effective masses of Sec. 2.4.5.

    Three slides on prismatic joints and an end-effector on three prismatic joints are tied
    by three distance constraints, the rods (2.30), which act at the velocity level of the
    SAP solver: errors are of first order in the time step. The plant's world frame becomes the
    inertial frame, with z_0 down, and the plant's gravity the robot's. Joints have no
    friction and drives no rotor inertia.

    Args:
        plant: A discrete plant that is not finalized yet.
        parameters: The robot.
        visual: Whether to register illustration geometry of everything but the rods, if the
            plant is registered with a scene graph (rods: ``DeltaVisualizer``).
        with_load: Whether the end-effector has the load's mass; if not, weld a body of that mass
            to it.

    Returns:
        The robot's parts in the plant.

    Raises:
        InputError: If the plant does not suit constraints.
    """
    _check_plant(plant)
    plant.mutable_gravity_field().set_gravity_vector(parameters.gravity)
    robot = DeltaRobot(parameters)
    instance = plant.AddModelInstance(parameters.name)
    masses, geometry = parameters.masses, parameters.geometry
    slides, actuators = [], []
    origins = slide_origins(geometry, np.zeros(robot.dimension))
    limits = robot.gather("position_limits")
    for i, name in enumerate(robot.names):
        body = _add_body(plant, name, instance, masses.effective_slide)
        rail = FixedOffsetFrame(
            f"rail_{i + 1}", plant.world_frame(), RigidTransform(origins[i]), instance
        )
        joint = plant.AddJoint(
            PrismaticJoint(
                name,
                plant.AddFrame(rail),
                body.body_frame(),
                -geometry.rails[i],
                pos_lower_limit=limits[i, 0],
                pos_upper_limit=limits[i, 1],
            )
        )
        drive = plant.AddJointActuator(name, joint, effort_limit=parameters.drives.effort[i])
        slides.append(joint)
        actuators.append(drive.index())
    mass = masses.effective_plate - (0.0 if with_load else masses.load)
    cartesian, end_effector = _add_end_effector(plant, instance, mass)
    for i, slide in enumerate(slides):
        plant.AddDistanceConstraint(
            slide.child_body(),
            np.zeros(3),
            end_effector,
            geometry.l_EC * geometry.directions[i],
            geometry.l_BC,
        )
    if visual:
        _add_visuals(plant, instance, parameters)
    return DeltaModel(
        robot, instance, tuple(slides), tuple(cartesian), tuple(actuators), end_effector
    )


def set_delta_positions(
    plant: MultibodyPlant,
    context: Context,
    model: DeltaModel,
    q: np.ndarray,
    v: np.ndarray | None = None,
) -> None:
    """Set positions and velocities that agree with the constraints.

    Args:
        plant: The finalized plant.
        context: Its context.
        model: The robot in it.
        q: Slide positions [m], shape (3,).
        v: Slide velocities [m/s], shape (3,); at rest if omitted.

    Raises:
        InputError: If the rods cannot meet.
    """
    y_t = model.robot.tool_position(q)
    if not np.all(np.isfinite(y_t)):
        raise InputError(
            f"slide positions {np.asarray(q).tolist()} m: the slides are too far apart for rods of "
            f"{model.robot.parameters.geometry.l_BC:.6g} m"
        )
    rates = np.zeros(len(model.slides)) if v is None else np.asarray(v)
    y_rate = model.robot.jacobian_at(q) @ rates
    for joints, values, speeds in ((model.slides, q, rates), (model.cartesian, y_t, y_rate)):
        for joint, value, speed in zip(joints, values, speeds, strict=True):
            joint.set_translation(context, value)
            joint.set_translation_rate(context, speed)


def slide_state_rows(plant: MultibodyPlant, model: DeltaModel) -> np.ndarray:
    """Return the matrix with ``[q, v] = rows x`` for the plant's state x, shape (6, num_states).

    Args:
        plant: The finalized plant.
        model: The robot in it.
    """
    n, num_positions = len(model.slides), plant.num_positions()
    rows = np.zeros((2 * n, num_positions + plant.num_velocities()))
    for i, joint in enumerate(model.slides):
        rows[i, joint.position_start()] = 1.0
        rows[n + i, num_positions + joint.velocity_start()] = 1.0
    return rows


def _check_plant(plant: MultibodyPlant) -> None:
    if plant.is_finalized():
        raise InputError("plant: finalized already; add the DELTA robot before Finalize()")
    if plant.time_step() == 0.0:
        raise InputError("plant: time step 0; constraints need a discrete plant, time step > 0")
    if plant.get_discrete_contact_solver() != DiscreteContactSolver.kSap:
        raise InputError(
            "plant: contact approximation TAMSI; constraints need kSap, kSimilar or kLagged"
        )


def _add_body(
    plant: MultibodyPlant, name: str, instance: ModelInstanceIndex, mass: float
) -> RigidBody:
    inertia = SpatialInertia.SolidSphereWithMass(mass, _BODY_RADIUS)
    return plant.AddRigidBody(name, instance, inertia)


def _add_end_effector(
    plant: MultibodyPlant, instance: ModelInstanceIndex, mass: float
) -> tuple[list[PrismaticJoint], RigidBody]:
    """Add the end-effector on joints along x_0, y_0 and z_0, massless bodies between them."""
    joints: list[PrismaticJoint] = []
    parent = plant.world_frame()
    for axis, direction in zip("xyz", np.eye(3), strict=True):
        if axis == "z":
            body = _add_body(plant, PLATE, instance, mass)
        else:
            body = plant.AddRigidBody(f"{PLATE}_{axis}", instance, SpatialInertia.Zero())
        joint = PrismaticJoint(f"{PLATE}_{axis}", parent, body.body_frame(), direction)
        joints.append(plant.AddJoint(joint))
        parent = body.body_frame()
    return joints, joints[-1].child_body()


def _add_visuals(
    plant: MultibodyPlant, instance: ModelInstanceIndex, parameters: DeltaParameters
) -> None:
    if not plant.geometry_source_is_registered():
        return
    for part in robot_parts(parameters):
        body = (
            plant.world_body()
            if part.carrier == BASE
            else plant.GetBodyByName(part.carrier, instance)
        )
        plant.RegisterVisualGeometry(
            body,
            part.X_CS,
            part.shape,
            f"{parameters.name}_{part.name}",
            np.array([part.color.r(), part.color.g(), part.color.b(), part.color.a()]),
        )
