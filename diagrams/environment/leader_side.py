"""The operator's side of a teleoperation, and the channel to it."""

from pydrake.lcm import DrakeLcm
from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.environment.channel_end import ChannelEnd
from diagrams.environment.leader import Leading, add_leader, port_limits
from diagrams.scenario.teleoperation import TeleoperationParameters
from pfsc_drake.control.teleoperation.message import MESSAGE
from pfsc_drake.controller.tasks.space_task import SpaceTask
from pfsc_drake.controller.tasks.task import Task
from pfsc_drake.controller.teleoperated import Teleoperated
from pfsc_drake.drivers.teleoperation_link import TeleoperationEnd
from pfsc_drake.physics.channel import Channel
from pfsc_drake.systems.block_system import BlockSystem


def teleoperated(
    parameters: TeleoperationParameters, task: Task, lag: float, period: float
) -> Teleoperated:
    """Return the follower's side of a teleoperation.

    Args:
        parameters: The teleoperation.
        task: Task of the tool.
        lag: Lag between the commanded and the actual tool [s].
        period: Sampling time [s].

    Raises:
        InputError: If the tank does not suit the follower.
    """
    speed = parameters.follower_speed
    if isinstance(task, SpaceTask):
        speed = max(speed, task.options.guidance.largest_speed)
    moment = parameters.follower_moment, parameters.follower_turning
    force = parameters.follower_force, speed
    limits = port_limits(parameters, "follower", force, moment, period)
    return Teleoperated(parameters, limits, parameters.axes, lag)


def add_leader_side(
    builder: DiagramBuilder, leading: Leading, message: OutputPort, *, paced: bool = True
) -> tuple[dict[str, OutputPort], TeleoperationEnd | None]:
    """Add leader and channel, or a link to a leader in another process.

    Args:
        builder: Builder of the diagram.
        leading: The leader.
        message: Message of the follower.
        paced: Whether a link to another process makes time wait for the clock.

    Returns:
        ``message_arrived`` at the follower, and signals of the leader; the link, if it is one.

    Raises:
        InputError: If nobody holds the leader, or its tank does not suit it.
    """
    way, period = leading.parameters, leading.period
    if way.lcm:
        link = TeleoperationEnd(DrakeLcm(way.lcm), "follower", way.silence)
        end = builder.AddNamedSystem("leader_link", ChannelEnd(link, period, paced=paced))
        builder.Connect(message, end.GetInputPort("sent"))
        return {"message_arrived": end.GetOutputPort("arrived")}, link

    def add(name: str, channel: Channel, sent: OutputPort) -> OutputPort:
        system = builder.AddNamedSystem(name, BlockSystem(channel, period))
        builder.Connect(sent, system.GetInputPort("sent"))
        return system.GetOutputPort("arrived")

    leader = add_leader(builder, leading)
    there = Channel(way.channel, MESSAGE, period)
    arrived = add("channel_there", there, leader.port.GetOutputPort("message"))
    back = add("channel_back", Channel(way.back, MESSAGE, period), message)
    builder.Connect(back, leader.port.GetInputPort("message"))
    return {"message_arrived": arrived} | leader.signals, None
