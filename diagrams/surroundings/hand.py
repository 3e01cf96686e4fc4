"""An operator whose hand guides the tool."""

from collections.abc import Callable

from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.scenario import Scenario
from diagrams.tasks.task import Task
from pfsc_drake.control.manifolds.manifold import ToolKinematics
from pfsc_drake.errors import InputError
from pfsc_drake.physics.hand_model import HandParameters
from pfsc_drake.physics.hand_way import Place
from pfsc_drake.physics.operator_hand import OperatorHand
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.block_system import BlockSystem


def add_hand(
    builder: DiagramBuilder,
    robot: RobotModel,
    task: Task,
    scenario: Scenario,
    joint_state: OutputPort,
) -> list[OutputPort]:
    """Add the scenario's hand, which sees where the tool really is.

    Its wrench is held together with all other forces, one sampling time more of delay.

    Args:
        builder: Builder of the diagram.
        robot: The robot.
        task: What it is to do, for targets in coordinates of its manifold.
        scenario: The scenario.
        joint_state: The true ``[q_J, v_J, q_M, v_M]``.

    Returns:
        The wrench on the tool point, world axes, shape (6,) [N, Nm]; none without hand.

    Raises:
        InputError: If a target is off the path, or the reaction delay no multiple of the
            sampling time.
    """
    if scenario.hand is None:
        return []
    hand = connect_hand(builder, robot, task, scenario, joint_state, OperatorHand)
    return [hand.GetOutputPort("wrench")]


def connect_hand(
    builder: DiagramBuilder,
    robot: RobotModel,
    task: Task,
    scenario: Scenario,
    joint_state: OutputPort,
    make: Callable[[HandParameters, float, Place], OperatorHand],
) -> BlockSystem:
    """Add a hand of some kind that sees where the tool really is.

    Args:
        builder: Builder of the diagram.
        robot: The robot.
        task: See :func:`add_hand`.
        scenario: The scenario, with a hand.
        joint_state: The true ``[q_J, v_J, q_M, v_M]``.
        make: Makes it of its properties, the sampling time [s] and what tells where coordinates
            of the manifold are.

    Raises:
        InputError: See :func:`add_hand`.
    """
    parameters, period = scenario.hand, scenario.controller.sampling_time
    assert parameters is not None
    if parameters.frame == "manifold":
        for i, place in enumerate(parameters.places()[1]):
            task.check_place(place, f"hand.waypoints[{i}].position")
    try:
        block = make(parameters, period, task.target())
    except InputError as error:
        raise InputError(f"hand.{error}") from None
    hand = builder.AddNamedSystem("operator_hand", BlockSystem(block, period))
    view = builder.AddNamedSystem("hand_view", BlockSystem(ToolKinematics(robot), period))
    builder.Connect(joint_state, view.GetInputPort("joint_state"))
    builder.Connect(view.GetOutputPort("tool_pose"), hand.GetInputPort("tool_pose"))
    return hand
