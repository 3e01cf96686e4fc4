"""An operator whose hand guides the tool."""

from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.robots.arm import Arm
from diagrams.scenario import PathFollowingScenario
from diagrams.scenario.checks import require
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import Path
from pfsc_drake.geometry.paths.target import PathTarget
from pfsc_drake.systems.control.tool_kinematics import ToolKinematics
from pfsc_drake.systems.physics.operator_hand import OperatorHand


def add_hand(
    builder: DiagramBuilder,
    arm: Arm,
    path: Path,
    scenario: PathFollowingScenario,
    joint_state: OutputPort,
) -> dict[str, OutputPort]:
    """Add the scenario's hand, which sees where the tool really is.

    Its wrench is held together with all other forces, one sampling time more of delay.

    Args:
        builder: Builder of the diagram.
        arm: The robot.
        path: Its path, for targets in path coordinates.
        scenario: The scenario.
        joint_state: The true ``[q_J, v_J, q_M, v_M]``.

    Returns:
        ``hand_wrench`` on the tool point, world axes, shape (6,) [N, Nm]; nothing without hand.

    Raises:
        InputError: If a target is off the path, or the reaction delay no multiple of the
            sampling time.
    """
    if scenario.hand is None:
        return {}
    if scenario.hand.frame == "manifold" and not path.closed:
        for i, waypoint in enumerate(scenario.hand.waypoints):
            on_path = 0.0 <= waypoint.position[0] <= path.length
            allowed = f"eta from 0 to {path.length:.6g} m"
            require(on_path, f"hand.waypoints[{i}].position", waypoint.position.tolist(), allowed)
    try:
        hand = OperatorHand(scenario.hand, scenario.controller.sampling_time, PathTarget(path))
    except InputError as error:
        raise InputError(f"hand.{error}") from None
    builder.AddNamedSystem("operator_hand", hand)
    view = builder.AddNamedSystem("hand_view", ToolKinematics(arm.chain))
    builder.Connect(joint_state, view.GetInputPort("joint_state"))
    builder.Connect(view.GetOutputPort("tool_pose"), hand.GetInputPort("tool_pose"))
    return {"hand_wrench": hand.GetOutputPort("wrench")}
