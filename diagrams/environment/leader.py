"""The operator's side of a teleoperation: device, hand, port, and the channel to it."""

from dataclasses import dataclass

import numpy as np
from pydrake.lcm import DrakeLcm
from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.environment.channel_end import ChannelEnd
from diagrams.environment.operator import Operator
from diagrams.scenario import HandParameters
from diagrams.scenario.teleoperation import TeleoperationParameters
from pfsc_drake.blocks.block import Block
from pfsc_drake.blocks.wiring_blocks import Linear
from pfsc_drake.checks import require
from pfsc_drake.control.teleoperation.coupling_parameters import PortLimits
from pfsc_drake.control.teleoperation.message import MESSAGE
from pfsc_drake.control.teleoperation.port import SIDES, TeleoperationPort
from pfsc_drake.controller.tasks.path_task import PathTask
from pfsc_drake.controller.tasks.space_task import SpaceTask
from pfsc_drake.controller.tasks.task import StartPoint, Task
from pfsc_drake.controller.teleoperated import Teleoperated
from pfsc_drake.drivers.teleoperation_link import TeleoperationEndpoint
from pfsc_drake.errors import InputError
from pfsc_drake.physics.channel import Channel
from pfsc_drake.physics.hand_path import CoordinateMap
from pfsc_drake.physics.leader_clutch import Clutch, TurningClutch
from pfsc_drake.physics.leader_device import LeaderDevice, LeaderWrist
from pfsc_drake.physics.operator_hand import LiveHand, OperatorHand
from pfsc_drake.systems.block_system import BlockSystem

_BEYOND = 0.5  # m


@dataclass(frozen=True)
class LeaderSide:
    """Operator's side of a teleoperation.

    Attributes:
        parameters: The teleoperation.
        hand: The simulated operator's hand.
        operator: A person at the leader, instead of the simulated hand.
        task: Task of the tool.
        start: Start of the tool.
        period: Sampling time [s].
    """

    parameters: TeleoperationParameters
    hand: HandParameters | None
    operator: Operator | None
    task: Task
    start: StartPoint
    period: float

    def add(
        self, builder: DiagramBuilder, message: OutputPort, *, paced: bool = True
    ) -> tuple[dict[str, OutputPort], TeleoperationEndpoint | None]:
        """Add leader and channel, or a link to a leader in another process.

        Args:
            builder: Builder of the diagram.
            message: Message of the follower.
            paced: Whether a link to another process makes time wait for the clock.

        Returns:
            ``message_arrived`` at the follower, and signals of the leader; the link, if there is
            one.

        Raises:
            InputError: If the leader has no operator, or its tank does not suit it.
        """
        parameters, period = self.parameters, self.period
        if parameters.lcm:
            lcm = DrakeLcm(parameters.lcm)
            link = TeleoperationEndpoint(lcm, "follower", parameters.silence)
            end = builder.AddNamedSystem("leader_link", ChannelEnd(link, period, paced=paced))
            builder.Connect(message, end.GetInputPort("sent"))
            return {"message_arrived": end.GetOutputPort("arrived")}, link

        def add_channel(name: str, channel: Channel, sent: OutputPort) -> OutputPort:
            system = builder.AddNamedSystem(name, BlockSystem(channel, period))
            builder.Connect(sent, system.GetInputPort("sent"))
            return system.GetOutputPort("arrived")

        port, signals = self.add_leader(builder)
        there = Channel(parameters.channel, MESSAGE, period)
        arrived = add_channel("channel_there", there, port.GetOutputPort("message"))
        back = add_channel("channel_back", Channel(parameters.back, MESSAGE, period), message)
        builder.Connect(back, port.GetInputPort("message"))
        return {"message_arrived": arrived} | signals, None

    def add_leader(self, builder: DiagramBuilder) -> tuple[BlockSystem, dict[str, OutputPort]]:
        """Add the leader device with the hand that moves it, and its port.

        Args:
            builder: Builder of the diagram.

        Returns:
            The port, its input ``message`` open, and signals for the log.

        Raises:
            InputError: If the leader has no operator, or the tank does not suit it.
        """
        parameters, period = self.parameters, self.period
        has_hand = self.hand is not None or self.operator is not None
        require(has_hand, "hand", "null", "given where there is a leader")
        turns = 0.0 if self.hand is None else self.hand.rotational_stiffness
        allowed = "0 where the leader does not turn (teleoperation.rotation)"
        require(parameters.axes > 3 or turns == 0.0, "hand.rotational_stiffness", turns, allowed)
        device, scale = parameters.leader, parameters.force_scale
        force = device.force_limit / scale, device.largest_speed * parameters.motion_scale
        moment, rotation = (0.0, 0.0), parameters.rotation
        if rotation is not None:
            wrist = device.wrist
            moment = (
                wrist.torque_limit / parameters.moment_scale,
                wrist.largest_speed * rotation.scale,
            )
        limits = port_limits(parameters, "leader", force, moment, period)

        def add(name: str, block: Block) -> BlockSystem:
            return builder.AddNamedSystem(name, BlockSystem(block, period))

        def connect(source: BlockSystem, port: str, sink: BlockSystem, into: str) -> None:
            builder.Connect(source.GetOutputPort(port), sink.GetInputPort(into))

        axes, y_0 = parameters.axes, self.start.target.y_t.tolist()
        scales = np.diag([scale] * 3 + [parameters.moment_scale] * 3)
        handle = add("leader", LeaderDevice(device, period))
        clutch = add("clutch", Clutch(parameters.motion_scale, y_0, parameters.clutch, period))
        leader = add("leader_port", TeleoperationPort("leader", parameters, limits))
        motor = add("leader_motor", Linear(scales[:3, :axes]))
        felt = add("leader_sensor", Linear(np.linalg.inv(scales)[:axes]))
        hand = self._add_hand(builder)
        connect(clutch, "pose", hand, "tool_pose")
        connect(hand, "wrench", handle, "hand_wrench")
        connect(hand, "wrench", felt, "vector")
        connect(handle, "position", clutch, "handle")
        connect(clutch, "position", leader, "position")
        connect(clutch, "grip", leader, "grip")
        connect(felt, "product", leader, "felt")
        connect(leader, "force", motor, "vector")
        connect(motor, "product", handle, "motor_force")
        signals = {
            "leader_record": leader.GetOutputPort("record"),
            "leader_state": handle.GetOutputPort("state"),
            "led_point": clutch.GetOutputPort("position"),
            "leader_motor": motor.GetOutputPort("product"),
            "leader_hand": hand.GetOutputPort("wrench"),
        }
        R_0 = self.start.target.R_e
        if rotation is not None:
            allowed = "null where the tool keeps no orientation"
            require(R_0 is not None, "teleoperation.rotation", "given", allowed)
        if rotation is not None and R_0 is not None:
            turned = add("leader_wrist", LeaderWrist(device.wrist, period))
            turning = add(
                "turning_clutch", TurningClutch(rotation.scale, R_0, parameters.clutch, period)
            )
            wrist_motor = add("wrist_motor", Linear(scales[3:]))
            connect(hand, "wrench", turned, "hand_wrench")
            connect(turned, "orientation", turning, "handle")
            connect(turning, "orientation", leader, "orientation")
            connect(turning, "seen", clutch, "orientation")
            connect(leader, "force", wrist_motor, "vector")
            connect(wrist_motor, "product", turned, "motor_moment")
            signals |= {
                "wrist_state": turned.GetOutputPort("state"),
                "led_orientation": turning.GetOutputPort("orientation"),
                "wrist_motor": wrist_motor.GetOutputPort("product"),
            }
        return leader, signals

    def _add_hand(self, builder: DiagramBuilder) -> BlockSystem:
        """Add the hand at the leader."""
        hand, operator, task, period = self.hand, self.operator, self.task, self.period
        if operator is not None:
            block: Block = LiveHand(operator.hand, period)
            live = builder.AddNamedSystem("live_hand", BlockSystem(block, period))
            builder.Connect(operator.pull, live.GetInputPort("request"))
            return live
        assert hand is not None
        target, is_open = task.target, isinstance(task, PathTask) and not task.path.closed
        if hand.frame == "manifold":
            for i, (eta, *beside) in enumerate(hand.target_points()[1].tolist()):
                # a hand that presses on at an end of the path is beyond it
                past = max(-eta, eta - task.length, 0.0) if is_open else 0.0
                key = f"hand.waypoints[{i}].position"
                require(
                    past <= _BEYOND, key, [eta, *beside], f"at most {_BEYOND:g} m beyond an end"
                )
                task.check_coordinates(np.array([eta if past == 0.0 else 0.0, *beside]), key)
        if is_open:
            target = _BeyondEnds(target, task.length)
        try:
            block = OperatorHand(hand, period, target)
        except InputError as error:
            raise InputError(f"hand.{error}") from None
        return builder.AddNamedSystem("operator_hand", BlockSystem(block, period))


@dataclass(frozen=True)
class _BeyondEnds:
    """Map from coordinates of an open path to the world, along its tangents beyond its ends.

    Attributes:
        to_world: Map from coordinates of the path itself to the world.
        length: Length of the path [m].
    """

    to_world: CoordinateMap
    length: float

    def __call__(self, coordinates: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] in the world, shape (3,) each."""
        eta = float(np.clip(coordinates[0], 0.0, self.length))
        if eta == coordinates[0]:
            return self.to_world(coordinates, rates)
        end = np.array([eta, *coordinates[1:]])
        at, along = self.to_world(end, np.array([1.0, 0.0, 0.0]))
        _, beside = self.to_world(end, np.array([0.0, *rates[1:]]))
        return at + (coordinates[0] - eta) * along, rates[0] * along + beside


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


def port_limits(
    parameters: TeleoperationParameters,
    side: str,
    force: tuple[float, float],
    moment: tuple[float, float],
    period: float,
) -> PortLimits:
    """Return the limits of a port.

    Args:
        parameters: The teleoperation.
        side: ``leader`` or ``follower``; the follower's robot is a sample late.
        force: Largest force and largest speed [N, m/s].
        moment: Largest moment and largest angular velocity [Nm, rad/s].
        period: Sampling time [s].

    Raises:
        InputError: If the tank cannot supply the energy of the forces in a sample or two.
    """
    turns, late = parameters.rotation is not None, SIDES.index(side)
    limits = PortLimits(*force, late, period, *(moment if turns else (0.0, 0.0)))
    initial, least = parameters.tank.initial, limits.reserve
    allowed = f"above {least:g} J, what the {side}'s forces take within a tick or two"
    require(initial > least, "teleoperation.tank.initial", initial, allowed)
    return limits
