"""An operator far away: device, hand and channel, and what they do to the tool."""

from dataclasses import dataclass

import numpy as np
from pydrake.lcm import DrakeLcm
from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.surroundings.channel_end import ChannelEnd
from diagrams.surroundings.leader import Leading, add_leader
from diagrams.tasks.space_guidance import SpaceTask
from diagrams.tasks.task import Task
from pfsc_drake.blocks.block import Block
from pfsc_drake.blocks.wiring_blocks import Linear, Sum
from pfsc_drake.control.teleoperation.message import MESSAGE
from pfsc_drake.control.teleoperation.port import TeleoperationPort
from pfsc_drake.control.teleoperation.reaction import FixtureReaction, LedOrientation, LedPoint
from pfsc_drake.drivers.teleoperation_link import TeleoperationEnd
from pfsc_drake.physics.channel import Channel
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.block_system import BlockSystem


@dataclass(frozen=True)
class LedFromAfar:
    """What an operator elsewhere does to a tool, before it is known where the tool is.

    Attributes:
        port: Port of the follower, to which is still to be told where the tool is.
        wrench: On the tool, as if a hand were there, shape (6,) [N, Nm].
        signals: What there is to log.
        axes: Of leader and follower.
        period: Sampling time [s].
        link: To a leader in another process.
    """

    port: BlockSystem
    wrench: OutputPort
    signals: dict[str, OutputPort]
    axes: int
    period: float
    link: TeleoperationEnd | None = None

    def lead(self, builder: DiagramBuilder, forces: dict[str, OutputPort]) -> OutputPort:
        """Return what the tool yields to: the operator, and what is measured at the tool.

        Args:
            builder: Builder of the diagram.
            forces: ``wrench_measured``.
        """
        total = builder.AddNamedSystem("led_wrench", BlockSystem(Sum(2, 6), self.period))
        builder.Connect(self.wrench, total.GetInputPort("term_0"))
        builder.Connect(forces["wrench_measured"], total.GetInputPort("term_1"))
        return total.GetOutputPort("sum")

    def connect(
        self,
        builder: DiagramBuilder,
        task: Task,
        robot: RobotModel,
        lag: float,
        ports: dict[str, OutputPort],
    ) -> dict[str, OutputPort]:
        """Tell the operator where the tool is and what it feels, and return signals for the log.

        Args:
            builder: Builder of the diagram.
            task: What the tool is to do.
            robot: The robot as it is believed.
            lag: Between what is asked of the tool and where it is [s].
            ports: ``wrench_measured``, ``joint_state`` as measured; within regions ``guidance``,
                and among paths that attract ``guides``.
        """
        if isinstance(task, SpaceTask):
            seen: Block = FixtureReaction(len(task.fixtures), self.axes, len(task.guides))
            source = {"record": ports["guidance"]}
            source |= {"guides": ports["guides"]} if task.guides else {}
        else:
            seen, source = LedPoint(robot, lag, self.axes), {"joint_state": ports["joint_state"]}
        system = builder.AddNamedSystem("follower_view", BlockSystem(seen, self.period))
        for name, port in source.items():
            builder.Connect(port, system.GetInputPort(name))
        builder.Connect(ports["wrench_measured"], system.GetInputPort("wrench"))
        for name in ("position", "felt"):
            builder.Connect(system.GetOutputPort(name), self.port.GetInputPort(name))
        if self.axes > 3:
            block = BlockSystem(LedOrientation(robot, lag), self.period)
            turned = builder.AddNamedSystem("follower_orientation", block)
            builder.Connect(ports["joint_state"], turned.GetInputPort("joint_state"))
            output = turned.GetOutputPort("orientation")
            builder.Connect(output, self.port.GetInputPort("orientation"))
        return self.signals


def add_operator_afar(
    builder: DiagramBuilder, leading: Leading, *, paced: bool = True
) -> LedFromAfar:
    """Add both sides and the channel between them, or the follower's side and a link.

    Args:
        builder: Builder of the diagram.
        leading: Who leads.
        paced: Whether a link to another process is what makes time wait for the clock.

    Raises:
        InputError: If nobody holds the leader, or tanks do not suit their sides.
    """
    way, period, speed = leading.parameters, leading.period, leading.parameters.follower_speed
    if isinstance(leading.task, SpaceTask):
        speed = max(speed, leading.task.guided.options.guidance.largest_speed)
    moment = way.follower_moment, way.follower_turning
    limits = leading.limits("follower", (way.follower_force, speed), moment)

    def add(name: str, block: Block) -> BlockSystem:
        return builder.AddNamedSystem(name, BlockSystem(block, period))

    port = add("follower_port", TeleoperationPort("follower", way, limits))
    wrench = add("follower_wrench", Linear(np.eye(6, way.axes)))
    builder.Connect(port.GetOutputPort("force"), wrench.GetInputPort("vector"))
    signals = {"follower_record": port.GetOutputPort("record")}
    told, heard = port.GetOutputPort("message"), port.GetInputPort("message")
    link = None
    if way.lcm:
        link = TeleoperationEnd(DrakeLcm(way.lcm), "follower", way.silence)
        end = builder.AddNamedSystem("leader_link", ChannelEnd(link, period, paced=paced))
        builder.Connect(told, end.GetInputPort("sent"))
        builder.Connect(end.GetOutputPort("arrived"), heard)
    else:
        leader = add_leader(builder, leading)
        there = add("channel_there", Channel(way.channel, MESSAGE, period))
        back = add("channel_back", Channel(way.back, MESSAGE, period))
        builder.Connect(leader.port.GetOutputPort("message"), there.GetInputPort("sent"))
        builder.Connect(there.GetOutputPort("arrived"), heard)
        builder.Connect(told, back.GetInputPort("sent"))
        builder.Connect(back.GetOutputPort("arrived"), leader.port.GetInputPort("message"))
        signals |= leader.signals
    return LedFromAfar(port, wrench.GetOutputPort("product"), signals, way.axes, period, link)
