"""Connections of drives, friction, forces and contact with a robot's MultibodyPlant."""

from collections.abc import Sequence

import numpy as np
from pydrake.geometry import GeometryId, SceneGraph
from pydrake.multibody.plant import (
    ContactModel,
    DiscreteContactApproximation,
    ExternallyAppliedSpatialForceMultiplexer,
    MultibodyPlant,
)
from pydrake.multibody.tree import Frame
from pydrake.systems.framework import DiagramBuilder, InputPort, LeafSystem, OutputPort
from pydrake.systems.primitives import Adder, MatrixGain

from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.serial.chain_from_plant import PlantCoordinates
from pfsc_drake.robot.tool_load import ToolLoad
from pfsc_drake.systems.plants.applied_wrenches import ExternalWrench
from pfsc_drake.systems.plants.reactions import ContactWrench, ToolReaction


def connect_actuation(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    coordinates: PlantCoordinates,
    torque: OutputPort,
) -> None:
    """Connect drive torques or forces with the plant's actuation.

    Args:
        builder: Builder of the diagram.
        plant: The plant.
        coordinates: Indices of the robot's drives in the plant's actuation.
        torque: Torques or forces, shape (N,) [Nm or N].
    """
    rows = coordinates.actuation_rows(plant.num_actuators())
    drives = builder.AddNamedSystem("drives", MatrixGain(rows))
    builder.Connect(torque, drives.get_input_port())
    builder.Connect(drives.get_output_port(), plant.get_actuation_input_port())


def connect_resistance(
    builder: DiagramBuilder, plant: MultibodyPlant, rows: np.ndarray, resistance: OutputPort
) -> None:
    """Connect friction with the plant, independent of the drives and their limits.

    Args:
        builder: Builder of the diagram.
        plant: The plant.
        rows: Map from the plant's state to the velocities of the drives, shape (N, num_states).
        resistance: Friction torques or forces, positive with the velocity, shape (N,).
    """
    forces = builder.AddNamedSystem("resistance", MatrixGain(rows[:, plant.num_positions() :].T))
    builder.Connect(resistance, forces.get_input_port())
    builder.Connect(forces.get_output_port(), plant.get_applied_generalized_force_input_port())


def add_external_wrench(
    builder: DiagramBuilder,
    tool: Frame,
    robot: RobotModel,
    wrench: OutputPort,
    joint_state: OutputPort,
) -> ExternalWrench:
    """Add the map of a wrench on the tool to bodies and to joints.

    Args:
        builder: Builder of the diagram.
        tool: Frame at the tool point.
        robot: The robot.
        wrench: Wrench at the tool point, world axes, shape (6,) [N, Nm].
        joint_state: Actual ``[q_J, v_J, q_M, v_M]``, shape (4N,).
    """
    push = builder.AddNamedSystem("external_wrench", ExternalWrench(tool, robot))
    builder.Connect(wrench, push.GetInputPort("wrench"))
    builder.Connect(joint_state, push.GetInputPort("joint_state"))
    return push


def connect_push(
    builder: DiagramBuilder, plant: MultibodyPlant, pushes: Sequence[LeafSystem]
) -> None:
    """Apply wrenches to the bodies of a plant.

    Args:
        builder: Builder of the diagram.
        plant: The plant.
        pushes: One system or more with the port ``applied_spatial_force``.
    """
    ports = [push.GetOutputPort("applied_spatial_force") for push in pushes]
    if len(ports) > 1:
        both = builder.AddNamedSystem(
            "spatial_forces", ExternallyAppliedSpatialForceMultiplexer(len(ports))
        )
        for i, port in enumerate(ports):
            builder.Connect(port, both.get_input_port(i))
        ports = [both.get_output_port()]
    builder.Connect(ports[0], plant.get_applied_spatial_force_input_port())


def connect_torques(builder: DiagramBuilder, port: InputPort, pushes: Sequence[LeafSystem]) -> None:
    """Apply wrenches as the equivalent joint torques.

    Args:
        builder: Builder of the diagram.
        port: Port of the plant, for external torques, shape (N,).
        pushes: One system or more with the port ``tau_ext``.
    """
    torques = [push.GetOutputPort("tau_ext") for push in pushes]
    if len(torques) > 1:
        total = builder.AddNamedSystem("external_torques", Adder(len(torques), port.size()))
        for i, torque in enumerate(torques):
            builder.Connect(torque, total.get_input_port(i))
        torques = [total.get_output_port()]
    builder.Connect(torques[0], port)


def add_tool_reaction(
    builder: DiagramBuilder,
    robot: RobotModel,
    load: ToolLoad,
    acceleration: OutputPort,
    ports: dict[str, OutputPort],
) -> OutputPort:
    """Return the load on a sensor in the flange, for a plant without reaction forces.

    Args:
        builder: Builder of the diagram.
        robot: The robot.
        load: Load behind the sensor.
        acceleration: Acceleration of the links, shape (N,).
        ports: ``true_joint_state`` ``[q_J, v_J, q_M, v_M]``, shape (4N,), and ``wrench_ext`` on
            the tool point, world axes, shape (6,), if forces act there.
    """
    reaction = builder.AddNamedSystem("tool_reaction", ToolReaction(robot, load))
    builder.Connect(ports["true_joint_state"], reaction.GetInputPort("joint_state"))
    builder.Connect(acceleration, reaction.GetInputPort("acceleration"))
    if "wrench_ext" in ports:
        builder.Connect(ports["wrench_ext"], reaction.GetInputPort("wrench"))
    return reaction.GetOutputPort("reaction")


def joint_state_of(
    builder: DiagramBuilder, plant_state: OutputPort, coordinates: PlantCoordinates
) -> OutputPort:
    """Return the actual ``[q_J, v_J, q_M, v_M]``, shape (4N,).

    Args:
        builder: Builder of the diagram.
        plant_state: State of the plant.
        coordinates: Indices of the robot's coordinates in it.
    """
    encoders = builder.AddNamedSystem("joint_encoders", MatrixGain(coordinates.rows))
    builder.Connect(plant_state, encoders.get_input_port())
    return encoders.get_output_port()


def add_scene(builder: DiagramBuilder, plant: MultibodyPlant) -> SceneGraph:
    """Add a scene graph, for contact between the geometries added afterwards.

    Args:
        builder: Builder of the diagram.
        plant: A discrete plant, not finalized.
    """
    scene_graph = builder.AddNamedSystem("scene_graph", SceneGraph())
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kLagged)
    plant.set_contact_model(ContactModel.kHydroelastic)
    return scene_graph


def connect_scene(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
    tool: list[GeometryId],
) -> ContactWrench:
    """Connect a finalized plant with its scene graph, and return the contact wrench on its tool.

    Args:
        builder: Builder of the diagram, with the plant in it.
        plant: The plant.
        scene_graph: Scene graph from :func:`add_scene`.
        tool: Contact geometries of the tool.
    """
    builder.Connect(
        plant.get_geometry_pose_output_port(),
        scene_graph.get_source_pose_port(plant.get_source_id()),
    )
    builder.Connect(scene_graph.get_query_output_port(), plant.get_geometry_query_input_port())
    contact = builder.AddNamedSystem("contact_wrench", ContactWrench(tool))
    builder.Connect(
        plant.get_contact_results_output_port(), contact.GetInputPort("contact_results")
    )
    return contact
