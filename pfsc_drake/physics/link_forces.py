"""Wrenches on the links of an arm: joint torques, and an operator who pushes a link."""

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
    """Computes points of action and joint torques of wrenches on links.

    Forces and torques act **on the robot**; their joint torques are
    ``tau_ext = sum_k J_k(q_J)^T wrench_k`` with the sign of (2.65a),
    ``D_E q'' + n_E = tau_J + tau_ext``.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        wrenches (input): ``[force, torque]`` at each of K points, world axes, shape (6K,)
            [N, Nm].
        points (output): Positions of the points in the world, shape (3K,) [m].
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
    """Return ``q -> points``, the positions of K points of links in the world.

    Args:
        chain: The arm, N joints.
        points: For each point the index of its link and where it is in that link's frame [m].

    Returns:
        Function of q, shape (N,), to stacked positions, shape (3K,) [m].
    """
    q = ca.SX.sym("q", chain.dimension)
    still = [jets.constant(q[i], 1) for i in range(chain.dimension)]
    positions = [position.coefficients[0] for position in points_on_links(chain, still, points)]
    return ca.Function("link_points", [q], [ca.densify(ca.vertcat(*positions))], ["q"], ["points"])


@once_per_content()
def link_torque_function(chain: SerialChain, points: Points) -> ca.Function:
    """Return ``(q, wrenches) -> tau_ext``, the sum of ``J_k^T wrench_k``, see (2.11).

    ``J_k`` is the geometric Jacobian of the k-th point; joints beyond its link have zero torque.

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
    """Parameters of an operator's hand on a link; stiffness and damping of a relaxed human arm.

    The hand pulls a point of the link by a spring and a damper, with a limited force. The target is
    the position of the point when it was grasped plus a minimum-jerk displacement.

    Attributes:
        link: Link or frame of the robot's model that is grasped.
        point: Grasped point in the axes of that link or frame [m], shape (3,).
        way: Displacement of the hand, world axes [m], shape (3,).
        begin: Time of grasping and begin of the motion [s].
        duration: Duration of the displacement [s].
        hold: Time at rest after the displacement [s].
        comes_back: Whether the hand then returns before it releases the link.
        stiffness: K [N/m].
        damping: D [N s/m].
        force_limit: Largest magnitude of the force [N].
        grip_ramp: Duration of grasping and of releasing the link [s].
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
        """Return parameters of the hand, with waypoints relative to the grasped point."""
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
    """A spring-damper between a point of a link and a moving hand, see :class:`HandModel`.

    The hand observes the point once per period, computes its velocity from the last two samples,
    and keeps its force constant until the next. Its motion begins at the grasped position.

    Ports:
        point (input): Position of the point in the world, shape (3,) [m].
        wrench (output): ``[force, torque]`` on the robot at the point, world axes, the torque
            zero, shape (6,) [N, Nm]; zero before grasping, and if the position is NaN or infinite.

    State:
        wrench; position at the last sample (``last``), and whether it was ``seen`` then; position
        when the point was grasped (``start``), and whether the hand ``holds`` it.

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
        """Return the states at the next tick; omitted ones keep their values."""
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
            point: Position of the point [m], shape (3,).
            velocity: Velocity of the point [m/s], shape (3,).
            start: Position when the point was grasped [m], shape (3,).
        """
        twist = ca.vertcat(velocity, ca.DM.zeros(3))
        return self._hand.output_wrench(
            time, self._hand.desired_wrench(time, point - start, twist)
        )[:3]
