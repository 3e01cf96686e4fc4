"""An operator far away: device, hand and channel, and what they do to the tool."""

from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.scenario import HandParameters
from diagrams.scenario.checks import require
from diagrams.scenario.teleoperation import TeleoperationParameters
from diagrams.surroundings.operator import Operator
from diagrams.tasks.path_following import PathTask
from diagrams.tasks.space_guidance import SpaceTask
from diagrams.tasks.task import Task
from pfsc_drake.blocks.block import Block
from pfsc_drake.blocks.wiring_blocks import Linear, Sum
from pfsc_drake.control.teleoperation.message import MESSAGE
from pfsc_drake.control.teleoperation.parameters import PortLimits
from pfsc_drake.control.teleoperation.port import TeleoperationPort
from pfsc_drake.control.teleoperation.reaction import FixtureReaction, LedPoint
from pfsc_drake.errors import InputError
from pfsc_drake.physics.channel import Channel
from pfsc_drake.physics.hand_way import Place
from pfsc_drake.physics.leader_device import Clutch, LeaderDevice
from pfsc_drake.physics.operator_hand import LiveHand, OperatorHand
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.block_system import BlockSystem

_BEYOND = 0.5  # m


@dataclass(frozen=True)
class LedFromAfar:
    """What an operator elsewhere does to a tool, before it is known where the tool is.

    Attributes:
        port: Port of the follower, whose ``position`` and ``felt`` are still to be connected.
        wrench: On the tool, as if a hand were there, shape (6,) [N, Nm].
        signals: What there is to log.
        period: Sampling time [s].
    """

    port: BlockSystem
    wrench: OutputPort
    signals: dict[str, OutputPort]
    period: float

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
            ports: ``wrench_measured``, ``joint_state`` as measured; within regions ``guidance``.
        """
        if isinstance(task, SpaceTask):
            seen: Block = FixtureReaction(len(task.fixtures))
            source = {"record": ports["guidance"]}
        else:
            seen, source = LedPoint(robot, lag), {"joint_state": ports["joint_state"]}
        system = builder.AddNamedSystem("follower_view", BlockSystem(seen, self.period))
        for name, port in source.items():
            builder.Connect(port, system.GetInputPort(name))
        builder.Connect(ports["wrench_measured"], system.GetInputPort("wrench"))
        for name in ("position", "felt"):
            builder.Connect(system.GetOutputPort(name), self.port.GetInputPort(name))
        return self.signals


def add_operator_afar(
    builder: DiagramBuilder,
    parameters: TeleoperationParameters,
    hand: HandParameters | None,
    operator: Operator | None,
    task: Task,
    start: np.ndarray,
    period: float,
) -> LedFromAfar:
    """Add leader, hand, both ports and the channel between them.

    Args:
        builder: Builder of the diagram.
        parameters: The teleoperation.
        hand: The simulated operator's hand.
        operator: A person at the leader, in place of it.
        task: What the tool is to do.
        start: Where the tool starts [m], shape (3,).
        period: Sampling time [s].

    Raises:
        InputError: If nobody holds the leader, or times do not suit the sampling time.
    """
    require(
        hand is not None or operator is not None, "hand", "null", "given where there is a leader"
    )

    def add(name: str, block: Block) -> BlockSystem:
        return builder.AddNamedSystem(name, BlockSystem(block, period))

    def connect(source: BlockSystem, port: str, sink: BlockSystem, into: str) -> None:
        builder.Connect(source.GetOutputPort(port), sink.GetInputPort(into))

    device = parameters.leader
    of_leader = PortLimits(
        device.force_limit / parameters.force_scale,
        device.largest_speed * parameters.motion_scale,
        0,
        period,
    )
    speed = parameters.follower_speed
    if isinstance(task, SpaceTask):
        speed = max(speed, task.guided.options.guidance.largest_speed)
    of_follower = PortLimits(parameters.follower_force, speed, 1, period)
    for side, limits in (("leader", of_leader), ("follower", of_follower)):
        least = limits.reserve
        allowed = f"above {least:g} J, what the {side}'s forces take within a tick or two"
        initial = parameters.tank.initial
        require(initial > least, "teleoperation.tank.initial", initial, allowed)
    handle = add("leader", LeaderDevice(device, period))
    clutch = add(
        "clutch", Clutch(parameters.motion_scale, start.tolist(), parameters.clutch, period)
    )
    leader = add("leader_port", TeleoperationPort("leader", parameters, of_leader))
    follower = add("follower_port", TeleoperationPort("follower", parameters, of_follower))
    there = add("channel_there", Channel(parameters.channel, MESSAGE, period))
    back = add("channel_back", Channel(parameters.back, MESSAGE, period))
    motor = add("leader_motor", Linear(parameters.force_scale * np.eye(3)))
    felt = add("leader_sensor", Linear(np.eye(3, 6) / parameters.force_scale))
    wrench = add("follower_wrench", Linear(np.eye(6, 3)))
    held = _add_hand(builder, hand, operator, task, period)
    connect(clutch, "pose", held, "tool_pose")
    connect(held, "wrench", handle, "hand_wrench")
    connect(held, "wrench", felt, "vector")
    connect(handle, "position", clutch, "handle")
    connect(clutch, "position", leader, "position")
    connect(clutch, "grip", leader, "grip")
    connect(felt, "product", leader, "felt")
    connect(leader, "force", motor, "vector")
    connect(motor, "product", handle, "motor_force")
    connect(leader, "message", there, "sent")
    connect(there, "arrived", follower, "message")
    connect(follower, "message", back, "sent")
    connect(back, "arrived", leader, "message")
    connect(follower, "force", wrench, "vector")
    signals = {
        "leader_record": leader.GetOutputPort("record"),
        "follower_record": follower.GetOutputPort("record"),
        "leader_state": handle.GetOutputPort("state"),
        "led_point": clutch.GetOutputPort("position"),
        "leader_motor": motor.GetOutputPort("product"),
        "leader_hand": held.GetOutputPort("wrench"),
    }
    return LedFromAfar(follower, wrench.GetOutputPort("product"), signals, period)


@dataclass(frozen=True)
class _BeyondEnds:
    """Where coordinates of an open path are in the world, along its tangents beyond its ends.

    Attributes:
        place: Where they are on it.
        length: Length of the path [m].
    """

    place: Place
    length: float

    def __call__(self, coordinates: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return position [m] and velocity [m/s] in the world, shape (3,) each."""
        eta = float(np.clip(coordinates[0], 0.0, self.length))
        if eta == coordinates[0]:
            return self.place(coordinates, rates)
        end = np.array([eta, *coordinates[1:]])
        at, along = self.place(end, np.array([1.0, 0.0, 0.0]))
        _, beside = self.place(end, np.array([0.0, *rates[1:]]))
        return at + (coordinates[0] - eta) * along, rates[0] * along + beside


def _add_hand(
    builder: DiagramBuilder,
    hand: HandParameters | None,
    operator: Operator | None,
    task: Task,
    period: float,
) -> BlockSystem:
    """Add the hand at the leader."""
    if operator is not None:
        block: Block = LiveHand(operator.hand, period)
        held = builder.AddNamedSystem("live_hand", BlockSystem(block, period))
        builder.Connect(operator.pull, held.GetInputPort("asked"))
        return held
    assert hand is not None
    target, is_open = task.target(), isinstance(task, PathTask) and not task.path.closed
    if hand.frame == "manifold":
        for i, (eta, *beside) in enumerate(hand.places()[1].tolist()):
            # a hand that presses the tool on at an end of its path is beyond it
            past = max(-eta, eta - task.length, 0.0) if is_open else 0.0
            key = f"hand.waypoints[{i}].position"
            require(past <= _BEYOND, key, [eta, *beside], f"at most {_BEYOND:g} m beyond an end")
            task.check_place(np.array([eta if past == 0.0 else 0.0, *beside]), key)
    if is_open:
        target = _BeyondEnds(target, task.length)
    try:
        block = OperatorHand(hand, period, target)
    except InputError as error:
        raise InputError(f"hand.{error}") from None
    return builder.AddNamedSystem("operator_hand", BlockSystem(block, period))
