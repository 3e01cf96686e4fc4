"""Wrenches on the links of an arm: what they mean in its joints, and hands that push there."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake import jets
from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, all_of, any_of, where
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.physics.hand_model import HandModel, HandParameters, HandWaypoint
from pfsc_drake.physics.scripted_force import require_vector
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.newton_euler import points_on_links
from pfsc_drake.robot.tool_load import joint_torque_function
from pfsc_drake.yaml.rules import NotNegative, Parameters, Positive

# index of a link, and where on it [m], shape (3,)
Points = Sequence[tuple[int, np.ndarray]]


class LinkForces(Block):
    """Tells where wrenches on links act and what they mean in the joints.

    Forces and torques act **on the robot**; ``tau_ext = sum_k J_k(q_J)^T wrench_k`` is what they
    mean at the joints, with the sign of (2.65a), ``D_E q'' + n_E = tau_J + tau_ext``.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        wrenches (input): ``[force, torque]`` at each of K points, world axes, shape (6K,)
            [N, Nm].
        points (output): Where the points are in the world, shape (3K,) [m].
        tau_ext (output): External torques on the link side, shape (N,) [Nm or N].

    Args:
        chain: The arm, N joints.
        points: The K points.
    """

    def __init__(self, chain: SerialChain, points: Points) -> None:
        self._n, size = chain.dimension, len(points)
        self._points = link_points_function(chain, points)
        self._torque = link_torque_function(chain, points)
        self.inputs = {
            "joint_state": Port(4 * self._n, "rad, rad/s or m, m/s"),
            "wrenches": Port(6 * size, "N, Nm"),
        }
        self.outputs = {"points": Port(3 * size, "m"), "tau_ext": Port(self._n, "Nm or N")}
        self.states = {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        q_J = u.joint_state[: self._n]
        tau_ext = self._torque(q_J, u.wrenches)
        acting = any_of(u.wrenches != 0.0)
        return {
            "points": self._points(q_J),
            "tau_ext": where(acting, tau_ext, ca.DM.zeros(self._n)),
        }


@once_per_content()
def link_points_function(chain: SerialChain, points: Points) -> ca.Function:
    """Return ``q -> points``, where K points of links are in the world, as numbers.

    Args:
        chain: The arm, N joints.
        points: For each point the index of its link and where it is in that link's frame [m].

    Returns:
        Function of q, shape (N,), to positions one after the other, shape (3K,) [m].
    """
    q = ca.SX.sym("q", chain.dimension)
    still = [jets.constant(q[i], 1) for i in range(chain.dimension)]
    places = [place.coefficients[0] for place in points_on_links(chain, still, points)]
    return ca.Function("link_points", [q], [ca.densify(ca.vertcat(*places))], ["q"], ["points"])


@once_per_content()
def link_torque_function(chain: SerialChain, points: Points) -> ca.Function:
    """Return ``(q, wrenches) -> tau_ext``, the sum of ``J_k^T wrench_k``, see (2.11).

    ``J_k`` is the geometric Jacobian of the k-th point; joints beyond its link bear nothing.

    Args:
        chain: The arm, N joints.
        points: For each point the index of its link and where it is in that link's frame [m].

    Returns:
        Function of q, shape (N,), and of wrenches ``[force, torque]`` on the arm at K points,
        world axes, shape (6K,) [N, Nm], to torques or forces of shape (N,) [Nm or N].
    """
    n = chain.dimension
    q, wrenches = ca.SX.sym("q", n), ca.SX.sym("wrenches", 6 * len(points))
    tau_ext = ca.SX(n, 1)
    for (link, point), wrench in zip(points, ca.vertsplit(wrenches, 6), strict=True):
        joints = link + 1
        tau_ext[:joints] += joint_torque_function(chain.up_to(link, point))(q[:joints], wrench)
    results = ca.cse([ca.densify(tau_ext)])
    return ca.Function("link_torque", [q, wrenches], results, ["q", "wrenches"], ["tau_ext"])


@dataclass
class LinkHandParameters(Parameters):
    """Properties of a hand on a link; stiffness and damping as of a relaxed human arm's.

    It pulls a point of the link by a spring and a damper, with a limited force, towards where
    the point was when the hand took hold, plus a way that grows with minimum jerk.

    Attributes:
        link: Link or frame of the robot's model that it holds.
        point: Where, in the axes of that link or frame [m], shape (3,).
        way: How far the hand moves, world axes [m], shape (3,).
        begin: When it takes hold and begins to move [s].
        duration: Duration of the way [s].
        hold: How long it stays at the end of the way [s].
        comes_back: Whether it then goes the way back, and lets go there; else it lets go.
        stiffness: K [N/m].
        damping: D [N s/m].
        force_limit: Largest magnitude of the force [N].
        grip_ramp: Time in which the hand takes hold and lets go [s].
    """

    link: str = ""
    point: np.ndarray = field(default_factory=lambda: np.zeros(3))
    way: np.ndarray = field(default_factory=lambda: np.zeros(3))
    begin: NotNegative = 0.0
    duration: Positive = 1.0
    hold: NotNegative = 0.0
    comes_back: bool = False
    stiffness: float = 300.0
    damping: float = 30.0
    force_limit: float = 45.0
    grip_ramp: float = 0.2

    def __post_init__(self) -> None:
        super().__post_init__()
        self.point = require_vector("point", self.point)
        self.way = require_vector("way", self.way)
        self.hand()

    def hand(self) -> HandParameters:
        """Return the hand, its waypoints from where the point is when it takes hold."""
        there = self.begin + self.duration
        times = [self.begin, there, there + self.hold]
        positions = [np.zeros(3), self.way, self.way]
        if self.hold == 0.0:
            del times[2], positions[2]
        if self.comes_back:
            times.append(times[-1] + self.duration)
            positions.append(np.zeros(3))
        return HandParameters(
            waypoints=[HandWaypoint(*pair) for pair in zip(times, positions, strict=True)],
            stiffness=self.stiffness,
            damping=self.damping,
            force_limit=self.force_limit,
            grip_ramp=self.grip_ramp,
            release=times[-1],
        )


class LinkHand(Block):
    """A spring-damper from a point of a link to a hand that moves, see :class:`HandModel`.

    The hand sees the point once per period, takes its velocity from the last two looks, and
    holds its force until the next. Its way begins where the point is when it takes hold.

    Ports:
        point (input): Where the point is in the world, shape (3,) [m].
        wrench (output): ``[force, torque]`` on the robot at the point, world axes, the torque
            zero, shape (6,) [N, Nm]; zero before the hand takes hold, and where the point is not
            finite.

    State:
        wrench; the point at the last look (``last``), and whether it was ``seen`` then; where it
        was when the hand took hold (``start``), and whether it ``holds``.

    Args:
        parameters: Properties of the hand.
        period: Sampling time [s].
    """

    expands = False  # tables

    def __init__(self, parameters: LinkHandParameters, period: float) -> None:
        self._begin, self._hand = parameters.begin, HandModel(parameters.hand())
        self._period = period
        self.inputs = {"point": Port(3, "m")}
        self.outputs = {"wrench": Port(6, "N, Nm")}
        self.states = {"wrench": 6, "last": 3, "seen": 1, "start": 3, "holds": 1}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        return {"wrench": x.wrench}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the next tick; what is left out stays."""
        time, sees = t * self._period, all_finite(u.point)
        takes = all_of(ca.logic_not(x.holds), time >= self._begin, sees)
        start = where(takes, u.point, x.start)
        holds = any_of(x.holds, takes)
        force = self.force(time, u.point, (u.point - x.last) / self._period, start)
        acts = all_of(holds, x.seen, sees)
        return {
            "wrench": ca.vertcat(where(acts, force, 0.0), ca.DM.zeros(3)),
            "last": u.point,
            "seen": sees,
            "start": start,
            "holds": holds,
        }

    def force(self, time: Any, point: Any, velocity: Any, start: Any) -> Any:
        """Return the force on the link, world axes, shape (3,) [N].

        Args:
            time: [s].
            point: Where the point is [m], shape (3,).
            velocity: Velocity of the point [m/s], shape (3,).
            start: Where the point was when the hand took hold [m], shape (3,).
        """
        twist = ca.vertcat(velocity, ca.DM.zeros(3))
        return self._hand.delivered(time, self._hand.wanted(time, point - start, twist))[:3]
