"""Operators who guide the tool: simulated, and interactive at a screen."""

import math
from dataclasses import dataclass
from typing import Annotated, Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, where
from pfsc_drake.errors import InputError
from pfsc_drake.physics.hand_model import (
    HandModel,
    HandParameters,
    limit_magnitude,
    observed_twist,
    orientation,
)
from pfsc_drake.physics.hand_path import CoordinateMap
from pfsc_drake.robot.robot_model import RobotModel, tool_motion_function
from pfsc_drake.yaml.rules import Parameters, Range

MAX_PERIODS = 10_000  # in a reaction delay, whose wrenches are all shifted at every tick


class OperatorHand(Block):
    """A spring-damper from the tool point to a moving target, see :class:`HandModel`.

    The operator observes the tool once per period, computes its velocity from the last two samples,
    and keeps the wrench constant until the next: with a reaction delay of n periods the wrench from
    t_k to t_{k+1} depends on the observation at t_{k-n}.

    Ports:
        tool_pose (input): ``[y_t, R_e]``, shape (12,); see :class:`ToolKinematics`.
        wrench (output): ``[force, torque]`` on the robot at the tool point, world axes,
            shape (6,) [N, Nm]; zero before the first tick. After a NaN or infinite tool pose the
            delayed wrench is zero.

    State:
        wrench; last_pose, and whether the tool was ``seen`` then; desired wrenches within the
        reaction delay (``waiting``), latest first, shape (6 n,).

    Args:
        parameters: Parameters of the operator.
        period: Sampling time [s].
        to_world: Map of coordinates of the frame ``manifold`` to the world, if needed.

    Raises:
        InputError: If the reaction delay is not a multiple of the period, up to MAX_PERIODS of
            it, or a path is missing.
    """

    expands = False  # tables

    def __init__(
        self, parameters: HandParameters, period: float, to_world: CoordinateMap | None = None
    ) -> None:
        self._hand, self._period = HandModel(parameters, to_world), period
        delay = round(min(parameters.reaction_delay / period, MAX_PERIODS))
        if abs(delay * period - parameters.reaction_delay) > 1e-9:
            raise InputError(
                f"reaction_delay = {parameters.reaction_delay} s: must be a multiple of the "
                f"sampling time {period:g} s, up to {MAX_PERIODS * period:g} s"
            )
        self.inputs = {"tool_pose": Port(12, "m, 1")}
        self.outputs = {"wrench": Port(6, "N, Nm")}
        self.states = {"wrench": 6, "last_pose": 12, "seen": 1, "waiting": 6 * delay}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        return {"wrench": x.wrench}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        time, sees = t * self._period, all_finite(u.tool_pose)
        twist = where(x.seen, observed_twist(x.last_pose, u.tool_pose, self._period), 0.0)
        desired_wrench = where(sees, self.desired_wrench(x, time, u.tool_pose, twist), 0.0)
        queue = ca.vertcat(desired_wrench, x.waiting)
        return {
            "wrench": self._hand.output_wrench(time, queue[-6:]),
            "last_pose": u.tool_pose,
            "seen": sees,
            "waiting": queue[:-6],
        }

    def desired_wrench(self, x: Values, time: Any, pose: Any, twist: Any) -> Any:
        """Return the desired wrench of the operator, world axes, shape (6,) [N, Nm].

        Args:
            x: States.
            time: [s].
            pose: ``[y_t, R_e by rows]``, shape (12,).
            twist: ``[y_t', w]``, shape (6,).
        """
        return self._hand.desired_wrench(time, pose[:3], twist, orientation(pose))


_LARGEST = 1e9  # of stiffness, damping and force; products do not overflow
_SLOWEST = 10.0  # s
# share of the grip below which a hand is open
_OPEN = 1e-3
# parts of a request, and of the lags
PUSH, HOLD, TARGET = slice(0, 3), 3, slice(4, 7)
REQUEST_SIZE = 7


@dataclass
class LiveHandParameters(Parameters):
    """Parameters of an interactive hand.

    Attributes:
        stiffness: K of a closed hand, between tool and target [N/m].
        damping: D of a closed hand [N s/m].
        rotational_damping: D_r of a closed hand [Nm s/rad].
        force_limit: Largest magnitude of the force [N].
        torque_limit: Largest magnitude of the torque [Nm].
        response_time: Time constant of each of two lags between request and force [s].
    """

    stiffness: Annotated[float, Range(0.0, _LARGEST, open=True)] = 400.0
    damping: Annotated[float, Range(0.0, _LARGEST)] = 30.0
    rotational_damping: Annotated[float, Range(0.0, _LARGEST)] = 0.3
    force_limit: Annotated[float, Range(0.0, _LARGEST, open=True)] = 45.0
    torque_limit: Annotated[float, Range(0.0, _LARGEST, open=True)] = 3.0
    response_time: Annotated[float, Range(0.0, _SLOWEST, "s", open=True)] = 0.05


class LiveHand(Block):
    """Interactive hand that pushes the tool or holds it at a target position.

    ``f = limit(f_2 + g_2 (K (p_2 - y_t) - D y_t'))``, ``tau = limit(-g_2 D_r w)``: the request -
    force f, grip g (0 or 1) and target p - passes two lags of first order,
    ``x_1' = (x - x_1) / T_r``, ``x_2' = (x_1 - x_2) / T_r``, so that the force is C^1 in time for
    any request. An open hand adopts its target without lag: it closes at the requested target, and
    not on the path there from the previous one. A hand that opens keeps its target.

    It samples tool and request once per period, and keeps its wrench constant until the next.

    Ports:
        request (input): Force, world axes [N], grip, 1 to hold the tool and otherwise 0, target
            position, world axes [m], shape (7,).
        tool_pose (input): ``[y_t, R_e]``, shape (12,); see :class:`ToolKinematics`.
        wrench (output): ``[force, torque]`` on the robot at the tool point, world axes,
            shape (6,) [N, Nm]; zero before the first tick, and while the tool pose is NaN or
            infinite.

    State:
        wrench; last_pose, and whether the tool was ``seen`` then; lags ``first`` and ``second`` of
        the request.

    Args:
        parameters: Parameters of the hand.
        period: Sampling time [s].
    """

    def __init__(self, parameters: LiveHandParameters, period: float) -> None:
        self._hand, self._period = parameters, period
        self.inputs = {"request": Port(REQUEST_SIZE, "N, 1, m"), "tool_pose": Port(12, "m, 1")}
        self.outputs = {"wrench": Port(6, "N, Nm")}
        sizes = {"wrench": 6, "last_pose": 12, "seen": 1}
        self.states = sizes | {"first": REQUEST_SIZE, "second": REQUEST_SIZE}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        return {"wrench": x.wrench}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        hand, request, pose = self._hand, u.request, u.tool_pose
        sees = all_finite(pose)
        share = -math.expm1(-self._period / hand.response_time)
        target = where(request[HOLD] > 0.5, request[TARGET], x.first[TARGET])
        request = ca.vertcat(request[: TARGET.start], target)
        is_taken = ca.DM(np.arange(REQUEST_SIZE) >= TARGET.start) * (x.first[HOLD] < _OPEN)
        first, second = where(is_taken, request, x.first), where(is_taken, request, x.second)
        second += share * (first - second)
        first += share * (request - first)
        grip = second[HOLD]
        twist = where(x.seen, observed_twist(x.last_pose, pose, self._period), 0.0)
        spring = hand.stiffness * (second[TARGET] - pose[:3]) - hand.damping * twist[:3]
        force = limit_magnitude(second[PUSH] + grip * spring, hand.force_limit)
        torque = limit_magnitude(-grip * hand.rotational_damping * twist[3:], hand.torque_limit)
        return {
            "wrench": where(sees, ca.vertcat(force, torque), 0.0),
            "last_pose": pose,
            "seen": sees,
            "first": where(sees, first, x.first),
            "second": where(sees, second, x.second),
        }


class ToolMotion(Block):
    """Direct kinematics (2.5) of a robot's links, and their rates (2.11).

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,) [rad, rad/s or m, m/s].
        tool_motion (output): ``[y_t, R_e by rows, v, w]``: tool point [m], orientation, velocity
            of the tool point [m/s] and angular velocity [rad/s], world axes, shape (18,).

    Args:
        robot: The robot.
    """

    def __init__(self, robot: RobotModel) -> None:
        self._size, self._motion = robot.dimension, tool_motion_function(robot)
        self.inputs = {"joint_state": Port(4 * robot.dimension, "rad, rad/s or m, m/s")}
        self.outputs, self.states = {"tool_motion": Port(18, "m, 1, m/s, rad/s")}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        n = self._size
        return {"tool_motion": self._motion(u.joint_state[:n], u.joint_state[n : 2 * n])}
