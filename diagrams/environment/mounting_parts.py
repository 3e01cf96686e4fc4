"""Gripper, plates and operator of mounting; hands on the tool."""

from collections.abc import Callable

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import ConstantVectorSource, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from diagrams.environment.mounting import Mounting, add_plate_plant, tool_transform
from diagrams.robots.part import RobotPart
from diagrams.scenario.plate import PlateParameters
from pfsc_drake.control.manifolds.manifold import ToolKinematics
from pfsc_drake.controller.sensed_force import Payload
from pfsc_drake.controller.tasks.task import StartPoint, Task
from pfsc_drake.errors import InputError
from pfsc_drake.physics.hand_model import HandParameters
from pfsc_drake.physics.hand_path import CoordinateMap
from pfsc_drake.physics.mounting_hand import MountingHand
from pfsc_drake.physics.operator_hand import OperatorHand, ToolMotion
from pfsc_drake.physics.suction import SuctionGripper, holding_cups
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.plants.applied_wrenches import AppliedForces


def add_hand(
    builder: DiagramBuilder,
    robot: RobotModel,
    task: Task,
    parameters: HandParameters,
    period: float,
    joint_state: OutputPort,
) -> OutputPort:
    """Add a hand on the tool, which reacts to the actual pose of the tool.

    Its wrench is held together with all other forces, a further delay of one sampling time.

    Args:
        builder: Builder of the diagram.
        robot: The robot.
        task: Its task, for targets in coordinates of its manifold.
        parameters: The hand.
        period: Sampling time [s].
        joint_state: Actual ``[q_J, v_J, q_M, v_M]``.

    Returns:
        The wrench on the tool point, world axes, shape (6,) [N, Nm].

    Raises:
        InputError: If a target is off the path, or the reaction delay is no multiple of the
            sampling time.
    """
    hand = connect_hand(builder, robot, task, parameters, period, joint_state, OperatorHand)
    return hand.GetOutputPort("wrench")


def connect_hand(
    builder: DiagramBuilder,
    robot: RobotModel,
    task: Task,
    parameters: HandParameters,
    period: float,
    joint_state: OutputPort,
    make: Callable[[HandParameters, float, CoordinateMap], OperatorHand],
) -> BlockSystem:
    """Add a hand of any kind, which reacts to the actual pose of the tool.

    Args:
        builder: Builder of the diagram.
        robot: The robot.
        task: Task, for targets of the hand in coordinates of its manifold.
        parameters: The hand.
        period: Sampling time [s].
        joint_state: Actual ``[q_J, v_J, q_M, v_M]``.
        make: Function that creates it from its parameters, the sampling time [s] and the map from
            coordinates of the manifold to the world.

    Raises:
        InputError: If a target is off the path, or the reaction delay is no multiple of the
            sampling time.
    """
    if parameters.frame == "manifold":
        for i, target in enumerate(parameters.target_points()[1]):
            task.check_coordinates(target, f"hand.waypoints[{i}].position")
    try:
        block = make(parameters, period, task.target)
    except InputError as error:
        raise InputError(f"hand.{error}") from None
    hand = builder.AddNamedSystem("operator_hand", BlockSystem(block, period))
    view = builder.AddNamedSystem("hand_view", BlockSystem(ToolKinematics(robot), period))
    builder.Connect(joint_state, view.GetInputPort("joint_state"))
    builder.Connect(view.GetOutputPort("tool_pose"), hand.GetInputPort("tool_pose"))
    return hand


def add_gripper(
    builder: DiagramBuilder,
    mounting: Mounting,
    part: RobotPart,
    start: StartPoint,
    period: float,
    joint_state: OutputPort,
) -> tuple[BlockSystem, dict[str, OutputPort]]:
    """Add plates and gripper.

    Args:
        builder: Builder of the diagram.
        mounting: Poses of the plates in magazine and frame.
        part: The robot.
        start: Start of its tool.
        period: Sampling time [s].
        joint_state: Actual ``[q_J, v_J, q_M, v_M]``.

    Returns:
        The gripper, its input ``vacuum`` open where an operator mounts; and signals for the log:
        ``plate_state``, ``plate_contact``, ``held``, ``gripper_wrench``.
    """
    plate = mounting.parameters
    poses, gravity = mounting.plates(start), part.gravity
    plates, bodies, contact = add_plate_plant(
        builder, plate, mounting.X_WM, mounting.X_WF, poses, gravity
    )
    motion = builder.AddNamedSystem("tool_motion", BlockSystem(ToolMotion(part.robot), period))
    builder.Connect(joint_state, motion.GetInputPort("joint_state"))
    grip = None
    if plate.start != "magazine":
        X_PT = poses[0].inverse() @ tool_transform(start)
        # the frame supports the weight of a plate that lies in it
        weight = plate.mass * gravity * (plate.start == "held")
        load = poses[0].rotation().matrix().T @ weight
        grip = holding_cups(plate.suction, 0, X_PT.rotation().matrix(), X_PT.translation(), load)
    half_size = np.array(plate.size[:2]) / 2.0
    cups = SuctionGripper(plate.suction, half_size, len(bodies), grip)
    gripper = builder.AddNamedSystem("gripper", BlockSystem(cups, period))
    state = plates.get_state_output_port()
    builder.Connect(motion.GetOutputPort("tool_motion"), gripper.GetInputPort("tool_motion"))
    builder.Connect(state, gripper.GetInputPort("plate_state"))
    applied = builder.AddNamedSystem("plate_pushes", AppliedForces(bodies))
    builder.Connect(gripper.GetOutputPort("pushes"), applied.get_input_port())
    builder.Connect(applied.get_output_port(), plates.get_applied_spatial_force_input_port())
    if plate.operator is None:
        builder.Connect(_scheduled_vacuum(builder, plate), gripper.GetInputPort("vacuum"))
    return gripper, {
        "plate_state": state,
        "plate_contact": contact.GetOutputPort("forces"),
        "held": gripper.GetOutputPort("held"),
        "gripper_wrench": gripper.GetOutputPort("wrench"),
    }


def _scheduled_vacuum(builder: DiagramBuilder, plate: PlateParameters) -> OutputPort:
    """Return a vacuum that ends at a time."""
    if np.isinf(plate.release):
        always = builder.AddNamedSystem("vacuum", ConstantVectorSource([1.0]))
        return always.get_output_port()
    times = plate.release * np.arange(3.0)
    ending = PiecewisePolynomial.ZeroOrderHold(times, np.array([[1.0, 0.0, 0.0]]))
    return builder.AddNamedSystem("vacuum", TrajectorySource(ending)).get_output_port()


def add_mounting_hand(
    builder: DiagramBuilder,
    mounting: Mounting,
    robot: RobotModel,
    task: Task,
    parameters: HandParameters,
    period: float,
    joint_state: OutputPort,
) -> BlockSystem:
    """Add the hand of an operator who mounts plates.

    Args:
        builder: Builder of the diagram.
        mounting: Poses of the plates in magazine and frame.
        robot: The robot.
        task: Task, for targets of the hand in coordinates of its manifold.
        parameters: The hand.
        period: Sampling time [s].
        joint_state: Actual ``[q_J, v_J, q_M, v_M]``.

    Returns:
        The hand, its input ``held`` open; its outputs are ``vacuum``, ``wrench`` on the tool
        point, world axes, shape (6,) [N, Nm], and ``phase``.

    Raises:
        InputError: If the hand does not suit the task.
    """
    operator, pin_length = mounting.parameters.operator, mounting.parameters.pins.length
    goal = mounting.X_WF.translation(), mounting.X_WF.rotation().matrix()

    def make(hand: HandParameters, period: float, to_world: CoordinateMap) -> MountingHand:
        assert operator is not None
        return MountingHand(hand, operator, goal, pin_length, period, to_world)

    return connect_hand(builder, robot, task, parameters, period, joint_state, make)


def payload_of(mounting: Mounting, gravity: np.ndarray) -> Payload:
    """Return the compensation of a plate behind a force/torque sensor while it is held.

    Args:
        mounting: The plates.
        gravity: Gravitational acceleration, world axes [m/s^2], shape (3,).
    """
    plate = mounting.parameters
    return Payload(plate.nominal_mass, np.array([0.0, 0.0, plate.size[2] / 2.0]), gravity)
