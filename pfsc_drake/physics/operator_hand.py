"""Hands that guide the tool: of a simulated operator, and of a person at a screen."""

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
    limited,
    observed_twist,
    orientation,
)
from pfsc_drake.physics.hand_way import Place
from pfsc_drake.robot.robot_model import RobotModel, tool_motion_function
from pfsc_drake.yaml.rules import Parameters, Range

MAX_PERIODS = 10_000  # in a reaction delay; every wrench of it is moved at every tick


class OperatorHand(Block):
    """A spring-damper from the tool point to a moving target, see :class:`HandModel`.

    The hand sees the tool once per period, takes its velocity from the last two looks,
    and holds its wrench until the next: a reaction delay of n periods means that the
    wrench from t_k to t_{k+1} answers what was seen at t_{k-n}.

    Ports:
        tool_pose (input): ``[y_t, R_e]``, shape (12,); see :class:`ToolKinematics`.
        wrench (output): ``[force, torque]`` on the robot at the tool point, world axes,
            shape (6,) [N, Nm]; zero before the first tick. A tool pose that is not
            finite makes the hand let go for one reaction.

    State:
        wrench; last_pose, and whether the tool was ``seen`` then; wrenches that are wanted but not
        delivered yet (``waiting``), latest first, shape (6 n,).

    Args:
        parameters: Properties of the hand.
        period: Sampling time [s].
        place: Where coordinates of the frame ``manifold`` are in the world, if needed.

    Raises:
        InputError: If the reaction delay is not a multiple of the period, up to MAX_PERIODS of
            it, or a path is missing.
    """

    expands = False  # tables

    def __init__(
        self, parameters: HandParameters, period: float, place: Place | None = None
    ) -> None:
        self._hand, self._period = HandModel(parameters, place), period
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
        """Return what is remembered at the next tick; what is left out stays."""
        time, sees = t * self._period, all_finite(u.tool_pose)
        twist = where(x.seen, observed_twist(x.last_pose, u.tool_pose, self._period), 0.0)
        wanted = where(sees, self.wanted(x, time, u.tool_pose, twist), 0.0)
        queue = ca.vertcat(wanted, x.waiting)
        return {
            "wrench": self._hand.delivered(time, queue[-6:]),
            "last_pose": u.tool_pose,
            "seen": sees,
            "waiting": queue[:-6],
        }

    def wanted(self, x: Values, time: Any, pose: Any, twist: Any) -> Any:
        """Return the wrench that the hand wants, world axes, shape (6,) [N, Nm].

        Args:
            x: States.
            time: [s].
            pose: ``[y_t, R_e by rows]``, shape (12,).
            twist: ``[y_t', w]``, shape (6,).
        """
        return self._hand.wanted(time, pose[:3], twist, orientation(pose))


_LARGEST = 1e9  # of stiffness, damping and force; what it multiplies stays within a float
_SLOWEST = 10.0  # s
# below this share of its grip a hand is open
_OPEN = 1e-3
# parts of what is asked, and of the memory
PUSH, HOLD, TARGET = slice(0, 3), 3, slice(4, 7)
ASKED = 7


@dataclass
class LiveHandParameters(Parameters):
    """Properties of a hand whose owner decides, at every instant, what it does.

    Attributes:
        stiffness: K, from the tool to where a holding hand wants it [N/m].
        damping: D of a holding hand [N s/m].
        rotational_damping: D_r, by which a holding hand resists turning [Nm s/rad].
        force_limit: Largest magnitude of the force [N].
        torque_limit: Largest magnitude of the torque [Nm].
        response_time: Time constant of each of two lags between what is asked and what the muscles
            do [s].
    """

    stiffness: Annotated[float, Range(0.0, _LARGEST, open=True)] = 400.0
    damping: Annotated[float, Range(0.0, _LARGEST)] = 30.0
    rotational_damping: Annotated[float, Range(0.0, _LARGEST)] = 0.3
    force_limit: Annotated[float, Range(0.0, _LARGEST, open=True)] = 45.0
    torque_limit: Annotated[float, Range(0.0, _LARGEST, open=True)] = 3.0
    response_time: Annotated[float, Range(0.0, _SLOWEST, "s", open=True)] = 0.05


class LiveHand(Block):
    """A hand that is asked for a push, and to hold the tool at a place.

    ``f = limit(f_2 + g_2 (K (p_2 - y_t) - D y_t'))``, ``tau = limit(-g_2 D_r w)``: what is asked -
    push f, grip g (0 or 1) and target p - passes two lags of first order,
    ``x_1' = (x - x_1) / T_r``, ``x_2' = (x_1 - x_2) / T_r``, so that the force is C^1 in time
    whatever a slider does. The target of an open hand is taken at once: a hand closes where it is
    asked to hold, not on the way there from where it held before. One that opens keeps its target.

    It sees tool and person once per period, and holds its wrench until the next.

    Ports:
        asked (input): Push, world axes [N], 1 to hold and 0 not to, place to hold at, world axes
            [m], shape (7,).
        tool_pose (input): ``[y_t, R_e]``, shape (12,); see :class:`ToolKinematics`.
        wrench (output): ``[force, torque]`` on the robot at the tool point, world axes,
            shape (6,) [N, Nm]; zero before the first tick, and while the tool pose is not finite.

    State:
        wrench; last_pose, and whether the tool was ``seen`` then; lags ``first`` and ``second`` of
        what is asked.

    Args:
        parameters: Properties of the hand.
        period: Sampling time [s].
    """

    def __init__(self, parameters: LiveHandParameters, period: float) -> None:
        self._hand, self._period = parameters, period
        self.inputs = {"asked": Port(ASKED, "N, 1, m"), "tool_pose": Port(12, "m, 1")}
        self.outputs = {"wrench": Port(6, "N, Nm")}
        sizes = {"wrench": 6, "last_pose": 12, "seen": 1}
        self.states = sizes | {"first": ASKED, "second": ASKED}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        return {"wrench": x.wrench}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the next tick; what is left out stays."""
        hand, asked, pose = self._hand, u.asked, u.tool_pose
        sees = all_finite(pose)
        share = -math.expm1(-self._period / hand.response_time)
        target = where(asked[HOLD] > 0.5, asked[TARGET], x.first[TARGET])
        asked = ca.vertcat(asked[: TARGET.start], target)
        is_taken = ca.DM(np.arange(ASKED) >= TARGET.start) * (x.first[HOLD] < _OPEN)
        first, second = where(is_taken, asked, x.first), where(is_taken, asked, x.second)
        second += share * (first - second)
        first += share * (asked - first)
        grip = second[HOLD]
        twist = where(x.seen, observed_twist(x.last_pose, pose, self._period), 0.0)
        held = hand.stiffness * (second[TARGET] - pose[:3]) - hand.damping * twist[:3]
        force = limited(second[PUSH] + grip * held, hand.force_limit)
        torque = limited(-grip * hand.rotational_damping * twist[3:], hand.torque_limit)
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
