"""What the process at the tool does to the robot that holds the workpiece, and who tells it."""

from dataclasses import dataclass

from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.robots.arm import Arm
from pfsc_drake.blocks.block import Block
from pfsc_drake.blocks.wiring_blocks import Hold
from pfsc_drake.control.estimation.reaction import Reaction
from pfsc_drake.control.manifolds.manifold import ToolKinematics
from pfsc_drake.systems.block_system import BlockSystem


@dataclass(frozen=True)
class HeldReaction:
    """What turns a wrench on the tool into that on the robot that holds the workpiece.

    Attributes:
        true: Of the true wrench and poses.
        measured: Of what the other robot's sensor measures, if the holder's law is told that.
        forces: What there is to tell the holder's law: ``wrench_ext`` and ``wrench_measured`` on
            the workpiece at its frame's origin, world axes, each (6,).
    """

    true: BlockSystem
    measured: BlockSystem | None
    forces: dict[str, OutputPort]

    def act(self, builder: DiagramBuilder, wrench: OutputPort, tool_pose: OutputPort) -> None:
        """Let the reaction to a wrench act.

        Args:
            builder: Builder of the diagram.
            wrench: On the tool at the tool point, world axes, as it is at the tick, shape (6,).
            tool_pose: The true ``[y_t, R_e by rows]``.
        """
        _feed(builder, self.true, wrench, tool_pose)

    def tell(self, builder: DiagramBuilder, wrench: OutputPort, tool_pose: OutputPort) -> None:
        """Tell the robot that holds the workpiece what the other one's sensor measures.

        Args:
            builder: Builder of the diagram.
            wrench: As measured on the tool at the tool point, world axes, shape (6,).
            tool_pose: ``[y_t, R_e by rows]`` as the other controller finds it.
        """
        if self.measured is not None:
            _feed(builder, self.measured, wrench, tool_pose)


def add_held_reaction(
    builder: DiagramBuilder,
    part: Arm,
    true_state: OutputPort,
    workpiece_pose: OutputPort | None,
    period: float,
) -> HeldReaction:
    """Add what lets a robot bear the process on the workpiece that it holds.

    Its inputs are connected when the other robot is there, by :meth:`HeldReaction.act` and
    :meth:`HeldReaction.tell`.

    Args:
        builder: Builder of the diagram.
        part: The robot, whose tool frame is the workpiece's.
        true_state: Its true ``[q_J, v_J, q_M, v_M]``.
        workpiece_pose: Where its controller takes the workpiece to be, if it is told what the
            other robot's sensor measures.
        period: Sampling time [s].
    """

    def add(name: str, block: Block, pose: OutputPort) -> BlockSystem:
        system = builder.AddNamedSystem(name, BlockSystem(block, period))
        builder.Connect(pose, system.GetInputPort("workpiece_pose"))
        return system

    view = BlockSystem(ToolKinematics(part.robot), period)
    builder.AddNamedSystem("workpiece_view", view)
    builder.Connect(true_state, view.GetInputPort("joint_state"))
    true = add("process_reaction", Reaction(), view.GetOutputPort("tool_pose"))
    # both robots bear the same over a tick
    hold = builder.AddNamedSystem("wrench_hold", BlockSystem(Hold(6), period))
    builder.Connect(true.GetOutputPort("reaction"), hold.GetInputPort("value"))
    held = hold.GetOutputPort("held")
    part.connect_wrench(builder, held, true_state)
    forces, measured = {"wrench_ext": held}, None
    if workpiece_pose is not None:
        measured = add("measured_reaction", Reaction(), workpiece_pose)
        forces["wrench_measured"] = measured.GetOutputPort("reaction")
    return HeldReaction(true, measured, forces)


def _feed(
    builder: DiagramBuilder, system: BlockSystem, wrench: OutputPort, tool_pose: OutputPort
) -> None:
    builder.Connect(wrench, system.GetInputPort("wrench"))
    builder.Connect(tool_pose, system.GetInputPort("tool_pose"))
