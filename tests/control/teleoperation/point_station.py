"""A leader, an operator and a point that follows among planes, as one function for many runs."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.network import Network, Wiring
from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.blocks.wiring_blocks import Constant, Linear, Sum
from pfsc_drake.control.fixtures.command_dynamics import ServoDynamics
from pfsc_drake.control.fixtures.fixture_guidance import GuidedTool
from pfsc_drake.control.fixtures.fixture_parameters import Admittance, GuidanceParameters
from pfsc_drake.control.fixtures.guidance import ProgramGuidance
from pfsc_drake.control.fixtures.near_regions import near_rows, reaches
from pfsc_drake.control.teleoperation.commanded_point import FixtureReaction
from pfsc_drake.control.teleoperation.coupling_parameters import CouplingParameters, PortLimits
from pfsc_drake.control.teleoperation.message import MESSAGE
from pfsc_drake.control.teleoperation.port import RECORD, TeleoperationPort
from pfsc_drake.geometry.shapes.plane import HalfSpace
from pfsc_drake.physics.channel import ChannelParameters, message_ages
from pfsc_drake.physics.leader_clutch import Clutch
from pfsc_drake.physics.leader_device import LeaderDevice, LeaderParameters

PERIOD = 1e-3
_LAG, _DELAY = 5e-3, 2e-3
_FOLLOWER_FORCE = 60.0  # N


class StudyHand(Block):
    """Operator model: a spring and damper from the handle to a target, and a push, both inputs.

    Ports:
        state (input): State of the handle, shape (6,) [m, m/s].
        asked (input): Target [m], push [N], stiffness [N/m], damping [N s/m], shape (8,).
        wrench (output): Wrench of the last tick, shape (6,) [N, Nm].

    State:
        wrench: Output wrench.
    """

    def __init__(self) -> None:
        self.inputs = {"state": Port(6, "m, m/s"), "requested": Port(8, "m, N, N/m, N s/m")}
        self.outputs, self.states = {"wrench": Port(6, "N, Nm")}, {"wrench": 6}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        return {"wrench": x.wrench}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        spring = u.requested[6] * (u.requested[:3] - u.state[:3]) - u.requested[7] * u.state[3:]
        return {"wrench": ca.vertcat(spring + u.requested[3:6], ca.DM.zeros(3))}


class LaggedPoint(Block):
    """A point behind velocity servos with a lag and a delay, before a wall that is a spring.

    Ports:
        velocity (input): Commanded velocity [m/s], shape (>= 6,): the last three count.
        wall (input): Position along x [m] and stiffness [N/m] of the wall, shape (2,).
        joint_state (output): Position and velocity, twice, shape (12,) [m, m/s].
        wrench (output): Wrench of the wall on the point, shape (6,) [N, Nm].

    State:
        position, velocity; waiting: Commands in the delay.
    """

    def __init__(self) -> None:
        ticks = round(_DELAY / PERIOD)
        self.inputs = {"velocity": Port(6, "m, m/s"), "wall": Port(2, "m, N/m")}
        self.outputs = {"joint_state": Port(12, "m, m/s"), "wrench": Port(6, "N, Nm")}
        self.states = {"position": 3, "velocity": 3, "waiting": 3 * ticks}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        push = -u.wall[1] * ca.fmax(0.0, x.position[0] - u.wall[0])
        state = ca.vertcat(x.position, x.velocity)
        return {
            "joint_state": ca.vertcat(state, state),
            "wrench": ca.vertcat(push, ca.DM.zeros(5)),
        }

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        queue = ca.vertcat(u.velocity[3:], x.waiting)
        commanded, decay = queue[-3:], math.exp(-PERIOD / _LAG)
        gap = x.velocity - commanded
        return {
            "position": x.position + commanded * PERIOD + gap * _LAG * (1.0 - decay),
            "velocity": commanded + gap * decay,
            "waiting": queue[:-3],
        }


@dataclass(frozen=True)
class PointStation:
    """Parameters of a teleoperated point.

    Attributes:
        coupling: Coupling of both sides.
        planes: Boundaries of the point, ``(point, normal)`` each.
        leader: The leader device.
        mass: Mass of the free motion [kg].
        damping: Damping of the free motion [N s/m].
    """

    coupling: CouplingParameters
    planes: Sequence[tuple[Sequence[float], Sequence[float]]] = ()
    leader: LeaderParameters = field(default_factory=LeaderParameters)
    mass: float = 2.0
    damping: float = 40.0


@dataclass(frozen=True)
class Motion:
    """Signals of a run by tick.

    Attributes:
        handle: Actual position and velocity of the handle, shape (ticks, 6) [m, m/s].
        hand: Force of the operator on the handle, shape (ticks, 3) [N].
        motor: Force of the motors on the handle, shape (ticks, 3) [N].
        point: Position of the point, shape (ticks, 3) [m].
        leader: Record of the leader's port, shape (ticks, size), see :data:`RECORD`.
        follower: Record of the follower's port.
        wall: Force of the wall on the point, shape (ticks, 3) [N].
        command: Commanded velocity, shape (ticks, 3) [m/s].
    """

    handle: np.ndarray
    hand: np.ndarray
    motor: np.ndarray
    point: np.ndarray
    leader: np.ndarray
    follower: np.ndarray
    wall: np.ndarray
    command: np.ndarray


class PointTeleoperation:
    """Both sides as one function of received messages and the operator's inputs.

    Args:
        station: Parameters of the station.
    """

    def __init__(self, station: PointStation) -> None:
        self._stepper = Stepper(_network(station))

    def run(
        self,
        requested: np.ndarray,
        there: ChannelParameters,
        back: ChannelParameters,
        wall: tuple[float, float] = (1.0, 0.0),
    ) -> Motion:
        """Return the signals of a run.

        Args:
            requested: Inputs of the operator model by tick, shape (ticks, 8), see
                :class:`StudyHand`.
            there: Channel from the leader to the follower.
            back: Channel from the follower to the leader.
            wall: Position along x [m] and stiffness [N/m] of the wall.
        """
        stepper = self._stepper
        ages = [message_ages(channel, PERIOD) for channel in (there, back)]
        messages = np.zeros((2, len(requested) + 1, MESSAGE))
        stepper.tick, none = 0, np.zeros(MESSAGE)
        names = ("handle", "hand", "motor", "joints", "leader", "follower", "wall", "reference")
        rows: dict[str, list[np.ndarray]] = {name: [] for name in names}
        stepper.start(requested=requested[0], wall=wall, to_leader=none, to_follower=none)
        arguments = stepper._step.arguments
        arguments["wall"][:] = wall
        results = stepper._step.results
        for k, inputs in enumerate(requested):
            arguments["requested"][:] = inputs
            for name, sent, age in zip(("to_follower", "to_leader"), messages, ages, strict=True):
                old = k - age[k % len(age)]
                arguments[name][:] = sent[old] if old >= 0 else 0.0
            arguments["t"][0] = k
            stepper._step.evaluate()
            messages[0, k], messages[1, k] = results["from_leader"], results["from_follower"]
            for name in names:
                rows[name].append(results[name].copy())
            stepper._x[:] = results["x_next"]
        logs = {name: np.array(row) for name, row in rows.items()}
        return Motion(
            logs["handle"],
            logs["hand"][:, :3],
            logs["motor"],
            logs["joints"][:, :3],
            logs["leader"],
            logs["follower"],
            logs["wall"][:, :3],
            logs["reference"][:, 3:6],
        )


def _network(station: PointStation) -> Network:
    coupling, device = station.coupling, station.leader
    force, speed = device.force_limit / coupling.force_scale, device.largest_speed
    of_leader = PortLimits(force, speed * coupling.motion_scale, 0, PERIOD)
    guidance = GuidanceParameters(largest_speed=1.0)
    of_follower = PortLimits(_FOLLOWER_FORCE, guidance.largest_speed, 1, PERIOD)
    clutch = Clutch(coupling.motion_scale, [0.0] * 3, [], PERIOD)
    blocks: dict[str, Network] = {
        "hand": Network.of(StudyHand()),
        "device": Network.of(LeaderDevice(device, PERIOD)),
        "clutch": Network.of(clutch, ["opened", "orientation"]),
        "leader": Network.of(TeleoperationPort("leader", coupling, of_leader)),
        "motor": Network.of(Linear(coupling.force_scale * np.eye(3))),
        "felt": Network.of(Linear(np.eye(3, 6) / coupling.force_scale)),
        "follower": Network.of(TeleoperationPort("follower", coupling, of_follower), ["grip"]),
        "wrench": Network.of(Linear(np.eye(6, 3))),
        "sum": Network.of(Sum(2, 6)),
        "guidance": Network.of(_guidance(station, guidance), ["active", "damping"]),
        "reaction": Network.of(FixtureReaction(len(station.planes))),
        "ready": Network.of(Constant([1.0])),
        "point": Network.of(LaggedPoint()),
    }  # fmt: skip
    return Wiring(
        blocks,
        {
            ("hand", "state"): ("device", "state"),
            ("hand", "requested"): "requested",
            ("device", "motor_force"): ("motor", "product"),
            ("device", "hand_wrench"): ("hand", "wrench"),
            ("clutch", "handle"): ("device", "position"),
            ("leader", "position"): ("clutch", "position"),
            ("leader", "message"): "to_leader",
            ("leader", "felt"): ("felt", "product"),
            ("leader", "grip"): ("clutch", "grip"),
            ("felt", "vector"): ("hand", "wrench"),
            ("motor", "vector"): ("leader", "force"),
            ("follower", "position"): ("reaction", "position"),
            ("follower", "message"): "to_follower",
            ("follower", "felt"): ("reaction", "felt"),
            ("wrench", "vector"): ("follower", "force"),
            ("sum", "term_0"): ("wrench", "product"),
            ("sum", "term_1"): ("point", "wrench"),
            ("guidance", "joint_state"): ("point", "joint_state"),
            ("guidance", "wrench"): ("sum", "sum"),
            ("guidance", "ready"): ("ready", "value"),
            ("reaction", "record"): ("guidance", "record"),
            ("reaction", "wrench"): ("point", "wrench"),
            ("point", "velocity"): ("guidance", "reference"),
            ("point", "wall"): "wall",
        },
        {
            "from_leader": ("leader", "message"),
            "from_follower": ("follower", "message"),
            "handle": ("device", "state"),
            "hand": ("hand", "wrench"),
            "motor": ("motor", "product"),
            "joints": ("point", "joint_state"),
            "leader": ("leader", "record"),
            "follower": ("follower", "record"),
            "wall": ("point", "wrench"),
            "reference": ("guidance", "reference"),
        },
    ).network()


def _guidance(station: PointStation, parameters: GuidanceParameters) -> ProgramGuidance:
    q, v = ca.SX.sym("q", 3), ca.SX.sym("v", 3)
    motion = ca.Function("motion", [q, v], [ca.vertcat(q, ca.DM.zeros(9), v, ca.DM.zeros(3))])
    planes = [HalfSpace(point, normal) for point, normal in station.planes]
    within = reaches(parameters, PERIOD, [0.0] * len(planes))
    tool = GuidedTool(
        motion,
        ServoDynamics(_LAG, _DELAY, PERIOD),
        Admittance(station.mass, station.damping, PERIOD),
        len(planes),
        near_rows(planes, within),
    )
    return ProgramGuidance(tool, parameters, [math.inf] * len(planes))


def of(record: np.ndarray, name: str) -> np.ndarray:
    """Return a signal of records by name, shape (ticks, size) or (ticks,)."""
    values = record[:, RECORD[name]]
    return values[:, 0] if values.shape[1] == 1 else values
