"""The operator's side of a teleoperation: the device, the hand at it, its port."""

from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.scenario import HandParameters
from diagrams.scenario.checks import require
from diagrams.scenario.teleoperation import TeleoperationParameters
from diagrams.surroundings.operator import Operator
from diagrams.tasks.path_following import PathTask
from diagrams.tasks.task import Task
from pfsc_drake.blocks.block import Block
from pfsc_drake.blocks.wiring_blocks import Linear
from pfsc_drake.control.teleoperation.parameters import PortLimits
from pfsc_drake.control.teleoperation.port import TeleoperationPort
from pfsc_drake.errors import InputError
from pfsc_drake.physics.hand_way import Place
from pfsc_drake.physics.leader_device import Clutch, LeaderDevice
from pfsc_drake.physics.operator_hand import LiveHand, OperatorHand
from pfsc_drake.systems.block_system import BlockSystem

_BEYOND = 0.5  # m


@dataclass(frozen=True)
class Leader:
    """The operator's side.

    Attributes:
        port: Its port, whose ``message`` is still to be connected.
        signals: What there is to log.
    """

    port: BlockSystem
    signals: dict[str, OutputPort]


def add_leader(
    builder: DiagramBuilder,
    parameters: TeleoperationParameters,
    hand: HandParameters | None,
    operator: Operator | None,
    task: Task,
    start: np.ndarray,
    period: float,
) -> Leader:
    """Add a device with a hand at it, and its port.

    Args:
        builder: Builder of the diagram.
        parameters: The teleoperation.
        hand: The simulated operator's hand.
        operator: A person at the leader, in place of it.
        task: What the tool is to do.
        start: Where the tool starts [m], shape (3,).
        period: Sampling time [s].

    Raises:
        InputError: If nobody holds the leader, or the tank does not suit it.
    """
    given = hand is not None or operator is not None
    require(given, "hand", "null", "given where there is a leader")
    device = parameters.leader
    limits = PortLimits(
        device.force_limit / parameters.force_scale,
        device.largest_speed * parameters.motion_scale,
        0,
        period,
    )
    require_tank(parameters, "leader", limits)

    def add(name: str, block: Block) -> BlockSystem:
        return builder.AddNamedSystem(name, BlockSystem(block, period))

    def connect(source: BlockSystem, port: str, sink: BlockSystem, into: str) -> None:
        builder.Connect(source.GetOutputPort(port), sink.GetInputPort(into))

    handle = add("leader", LeaderDevice(device, period))
    clutch = add(
        "clutch", Clutch(parameters.motion_scale, start.tolist(), parameters.clutch, period)
    )
    leader = add("leader_port", TeleoperationPort("leader", parameters, limits))
    motor = add("leader_motor", Linear(parameters.force_scale * np.eye(3)))
    felt = add("leader_sensor", Linear(np.eye(3, 6) / parameters.force_scale))
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
    return Leader(
        leader,
        {
            "leader_record": leader.GetOutputPort("record"),
            "leader_state": handle.GetOutputPort("state"),
            "led_point": clutch.GetOutputPort("position"),
            "leader_motor": motor.GetOutputPort("product"),
            "leader_hand": held.GetOutputPort("wrench"),
        },
    )


def require_tank(parameters: TeleoperationParameters, side: str, limits: PortLimits) -> None:
    """Refuse a tank that could not pay the forces of a tick or two.

    Args:
        parameters: The teleoperation.
        side: ``leader`` or ``follower``.
        limits: What its port may count on.
    """
    initial, least = parameters.tank.initial, limits.reserve
    allowed = f"above {least:g} J, what the {side}'s forces take within a tick or two"
    require(initial > least, "teleoperation.tank.initial", initial, allowed)


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
