"""Force of the process at the tool on the robot that holds the workpiece."""

from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.robots.arm import Arm
from pfsc_drake.blocks.wiring_blocks import Hold
from pfsc_drake.control.estimation.reaction import Reaction
from pfsc_drake.control.manifolds.manifold import ToolKinematics
from pfsc_drake.systems.block_system import BlockSystem


def add_held_reaction(
    builder: DiagramBuilder, part: Arm, true_state: OutputPort, period: float
) -> tuple[BlockSystem, OutputPort]:
    """Let a robot bear the process on the workpiece that it holds.

    Args:
        builder: Builder of the diagram.
        part: The robot, whose tool frame is the workpiece's.
        true_state: Its true ``[q_J, v_J, q_M, v_M]``.
        period: Sampling time [s].

    Returns:
        The reaction, its inputs ``wrench`` and ``tool_pose`` of the other robot open; and the
        wrench on the workpiece at its frame's origin, world axes, shape (6,) [N, Nm].
    """
    view = builder.AddNamedSystem("workpiece_view", BlockSystem(ToolKinematics(part.robot), period))
    builder.Connect(true_state, view.GetInputPort("joint_state"))
    reaction = builder.AddNamedSystem("process_reaction", BlockSystem(Reaction(), period))
    builder.Connect(view.GetOutputPort("tool_pose"), reaction.GetInputPort("workpiece_pose"))
    # both robots bear the same over a sample
    hold = builder.AddNamedSystem("wrench_hold", BlockSystem(Hold(6), period))
    builder.Connect(reaction.GetOutputPort("reaction"), hold.GetInputPort("value"))
    held = hold.GetOutputPort("held")
    part.connect_wrench(builder, held, true_state)
    return reaction, held
