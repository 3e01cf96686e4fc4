"""Operator model of mounting: grasp a plate and insert its pins into the bores of a frame."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from pfsc_drake.blocks.block import Port, Values
from pfsc_drake.blocks.cases import all_finite, all_of, any_of, first_of, where
from pfsc_drake.errors import require
from pfsc_drake.physics.hand_model import HandParameters, limit_magnitude, orientation
from pfsc_drake.physics.hand_path import CoordinateMap
from pfsc_drake.physics.operator_hand import OperatorHand
from pfsc_drake.yaml.rules import NotNegative, Parameters, Positive, Seed

TASKS = ("mount", "return")


@dataclass
class MountingHandParameters(Parameters):
    """Parameters of an operator who mounts a plate.

    Positioning forces depend on the observed deviation: a proportional part and an integral part,
    until there is contact; then the hands are guided by the bores.

    Attributes:
        task: ``mount``: grasp the plate, guide it to the frame, insert it, release it and retreat;
            ``return``: release a plate in the frame, guide the gripper back, grasp the next.
        press: Force along the tool's axis while grasping [N].
        reach: Largest distance of the target ahead of the tool [m]; beyond it the target waits.
        insert: Force along the tool's axis while inserting [N].
        leave: Force against the tool's axis when retreating [N].
        leave_distance: Distance of the retreat [m].
        hover: Gap between pins and frame at which the operator stops to align [m].
        eye_error: Standard deviation of the observed position of the bores, along each of two
            transversal axes [m]; errors are cut off at twice the deviation.
        eye_angle: Standard deviation of their orientation, about each of three axes [rad].
        eye_gap: Smallest visible gap between plate and frame [m].
        stiffness: Transversal force per observed deviation [N/m].
        persistence: Integral gain of that force [N/(m s)].
        side_limit: Limit of the integral part of the transversal force [N].
        turning_stiffness: Moment per observed angle [Nm/rad].
        turning_persistence: Integral gain of that moment [Nm/(rad s)].
        turning_limit: Limit of the integral part of the moment [Nm].
        search_radius: Radius of the spiral in which the operator searches for the bores [m].
        search_time: Time until the spiral has this radius [s].
        search_period: Duration of one turn of the spiral [s].
        captured: Depth in the bores from which on they guide the hands [m].
        relaxation: Time constant with which the integral parts then decay [s].
        wobble: Moment by which a plate that sticks is moved to and fro [Nm].
        patience: Time without motion until the operator changes the strategy [s].
        look_time: Longest time of alignment [s].
        seed: Seed of the errors of observation.
    """

    task: str = "mount"
    press: Positive = 35.0
    reach: Positive = 0.13
    insert: Positive = 9.0
    leave: Positive = 25.0
    leave_distance: Positive = 0.015
    hover: Positive = 2e-3
    eye_error: NotNegative = 5e-4
    eye_angle: NotNegative = 2e-3
    eye_gap: Positive = 5e-4
    stiffness: NotNegative = 2000.0
    persistence: NotNegative = 4000.0
    side_limit: Positive = 15.0
    turning_stiffness: NotNegative = 100.0
    turning_persistence: NotNegative = 40.0
    turning_limit: Positive = 1.5
    search_radius: NotNegative = 1.5e-3
    search_time: Positive = 4.0
    search_period: Positive = 1.5
    captured: Positive = 4e-3
    relaxation: Positive = 1.0
    wobble: NotNegative = 1.0
    patience: Positive = 0.5
    look_time: Positive = 5.0
    seed: Seed = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.task in TASKS, "task", self.task, " or ".join(TASKS))


_LARGEST_ERROR = 2.0  # standard deviations of errors of observation
_NOTHING = ca.DM.zeros(3)


class MountingPhase(IntEnum):
    """Phase of mounting."""

    GRIP = 0
    LEAD = 1
    ALIGN = 2
    INSERT = 3
    RELEASE = 4
    LEAVE = 5
    DONE = 6


class MountingHand(OperatorHand):
    """Operator model that mounts a plate in several phases.

    The *goal* is the tool's pose when the plate is seated; the operator observes it with a random
    error, constant over a run. The target follows the waypoints, as in :class:`OperatorHand`; their
    times are relative to the grasping of the plate, or to its release. Sampling, reaction delay,
    tremor and force limits are those of :class:`OperatorHand`.

    ========  ====================================================================================
    grip      presses along the tool's axis until all cups hold
    lead      follows the waypoints, and waits if the tool is too far behind
    align     stops above the bores and moves the plate to their observed position
    insert    pushes along the axis of the bores; without progress, searches for them in a spiral
              around their observed position; once the pins are in the bores, is guided by them, and
              moves a plate that sticks to and fro
    release   ends the vacuum, and waits
    leave     retreats
    done      exerts no force
    ========  ====================================================================================

    Ports, in addition to those of :class:`OperatorHand`:
        held (input): Share of the gripper's cups that hold, shape (1,).
        vacuum (output): 1 while the vacuum is on, shape (1,).
        phase (output): :class:`MountingPhase`, shape (1,).

    State, in addition:
        phase, its begin ``since`` [s], zero of the waypoints' ``clock`` [s], integral parts
        ``force`` [N] and ``torque`` [Nm], world axes, ``deepest`` depth [m] and its time ``when``
        [s].

    Args:
        parameters: Parameters of the operator, with the waypoints.
        mounting: Parameters of mounting.
        goal: Tool point and orientation when the plate is seated, shapes (3,) and (3, 3).
        pin_length: Pin length of the plate [m].
        period: Sampling time [s].
        to_world: Map of waypoints of the frame ``manifold`` to the world, if needed.

    Raises:
        InputError: If the reaction delay is not a multiple of the period.
    """

    def __init__(
        self,
        parameters: HandParameters,
        mounting: MountingHandParameters,
        goal: tuple[np.ndarray, np.ndarray],
        pin_length: float,
        period: float,
        to_world: CoordinateMap | None = None,
    ) -> None:
        super().__init__(parameters, period, to_world)
        self._mounting, self._pin_length = mounting, pin_length
        self._returns = mounting.task == "return"
        random = np.random.default_rng(mounting.seed)
        errors = np.clip(random.standard_normal(5), -_LARGEST_ERROR, _LARGEST_ERROR)
        goal_p, goal_R = goal
        turn = Rotation.from_rotvec(mounting.eye_angle * errors[2:]).as_matrix()
        self._p = ca.DM(goal_p + goal_R @ np.append(mounting.eye_error * errors[:2], 0.0))
        self._R, self._axis = ca.DM(goal_R @ turn), ca.DM(goal_R[:, 2])
        self.inputs = {**self.inputs, "held": Port(1)}
        self.outputs = {**self.outputs, "vacuum": Port(1), "phase": Port(1)}
        sizes = {"phase": 1, "since": 1, "clock": 1, "force": 3, "torque": 3}
        self.states = {**self.states, **sizes, "deepest": 1, "when": 1}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states; omitted ones are zero."""
        return {
            "phase": float(MountingPhase.RELEASE if self._returns else MountingPhase.GRIP),
            "since": self._hand.begin,
            "deepest": -np.inf,
        }

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        off = [MountingPhase.LEAVE, MountingPhase.RELEASE, MountingPhase.DONE]
        if self._returns:
            off = [MountingPhase.LEAVE, MountingPhase.LEAD]
        vacuum = ca.logic_not(any_of(*[x.phase == phase for phase in off]))
        return super().output(x, u, t) | {"vacuum": vacuum, "phase": x.phase}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        after = self.next_states(x, t * self._period, u.tool_pose, u.held)
        sees = all_finite(u.tool_pose)
        after = {name: where(sees, value, getattr(x, name)) for name, value in after.items()}
        return super().update(x, u, y, t) | after

    def desired_wrench(self, x: Values, time: Any, pose: Any, twist: Any) -> Any:
        """Return the desired wrench of the operator, world axes, shape (6,) [N, Nm]."""
        hand, tool_axis = self._mounting, orientation(pose)[:, 2]
        lead = self._hand.desired_wrench(time - x.clock, pose[:3], twist, reach=hand.reach)
        return first_of(
            (x.phase == MountingPhase.LEAD, lead),
            (x.phase == MountingPhase.GRIP, ca.vertcat(hand.press * tool_axis, _NOTHING)),
            (x.phase == MountingPhase.LEAVE, ca.vertcat(-hand.leave * tool_axis, _NOTHING)),
            (_is_placing(x), self._placing_wrench(x, time, pose)),
            otherwise=0.0,
        )

    def _placing_wrench(self, x: Values, time: Any, pose: Any) -> Any:
        """Return the wrench of aligning and inserting the plate."""
        hand, across, angle = self._mounting, *self._goal_deviation(x, time, pose)
        captured, sticks = self._is_captured(x, pose), time - x.when > hand.patience
        wobble = hand.wobble * self._circle((time - x.when) / hand.search_period)
        force = x.force + where(captured, 0.0, hand.stiffness * across)
        torque = x.torque + first_of(
            (ca.logic_not(captured), hand.turning_stiffness * angle),
            (sticks, wobble),
            otherwise=0.0,
        )
        above = -(self._pin_length + hand.hover) - self._depth(pose)
        stopping = ca.fmin(ca.fmax(hand.stiffness * above, -hand.insert), hand.insert)
        along = where(x.phase == MountingPhase.INSERT, hand.insert, stopping)
        return ca.vertcat(force + along * self._axis, torque)

    def _depth(self, pose: Any) -> Any:
        """Return the depth of the plate, negative before it is seated [m]."""
        return ca.dot(self._axis, pose[:3] - self._p)

    def _is_captured(self, x: Values, pose: Any) -> Any:
        depth = self._mounting.captured - self._pin_length
        return all_of(x.phase == MountingPhase.INSERT, self._depth(pose) > depth)

    def _goal_deviation(self, x: Values, time: Any, pose: Any) -> tuple[Any, Any]:
        """Return the observed deviation of the goal, transversal [m] and angular [rad]."""
        away = self._p + self._spiral(x, time) - pose[:3]
        across = away - self._axis * ca.dot(self._axis, away)
        turn = self._R @ orientation(pose).T
        return across, ca.inv_skew((turn - turn.T) / 2.0)

    def _spiral(self, x: Values, time: Any) -> Any:
        """Return the offset of the search spiral from the observed bores [m], shape (3,)."""
        hand = self._mounting
        searching = time - x.since - hand.patience
        radius = hand.search_radius * ca.fmin(searching / hand.search_time, 1.0)
        searches = all_of(x.phase == MountingPhase.INSERT, searching >= 0.0)
        return where(searches, radius * self._circle(searching / hand.search_period), 0.0)

    def _circle(self, turns: Any) -> Any:
        """Return a direction across the axis of the bores after a number of turns, shape (3,)."""
        angle = 2.0 * np.pi * turns
        return self._R @ ca.vertcat(ca.cos(angle), ca.sin(angle), 0.0)

    def next_states(self, x: Values, time: Any, pose: Any, holding: Any) -> dict[str, Any]:
        """Return the states of mounting one period later.

        Args:
            x: States.
            time: [s].
            pose: ``[y_t, R_e by rows]``, shape (12,).
            holding: Share of the cups that hold.
        """
        target, _ = self._hand.target(time - x.clock)
        is_ahead = ca.norm_2(target - pose[:3]) > self._mounting.reach
        waits = all_of(x.phase == MountingPhase.LEAD, is_ahead)
        states = Values(
            phase=x.phase, since=x.since, clock=x.clock + self._period * waits,
            **self._integral_parts(x, time, pose),
        )  # fmt: skip
        phase = self._next_phase(states, time, pose, holding)
        begins, leads = phase != x.phase, phase == MountingPhase.LEAD
        return vars(states) | {
            "phase": phase,
            "since": where(begins, time, states.since),
            "when": where(begins, time, states.when),
            "deepest": where(begins, self._depth(pose), states.deepest),
            "clock": where(all_of(begins, leads), time - self._hand.begin, states.clock),
        }

    def _integral_parts(self, x: Values, time: Any, pose: Any) -> dict[str, Any]:
        """Return the integral parts of force and moment, and the depth, one period later."""
        hand, depth = self._mounting, self._depth(pose)
        deeper = all_of(_is_placing(x), depth > x.deepest + hand.eye_gap / 2.0)
        relaxed = 1.0 - min(self._period / hand.relaxation, 1.0)
        share = where(self._is_captured(x, pose), relaxed, 1.0)
        across, angle = self._goal_deviation(x, time, pose)
        force = x.force + self._period * hand.persistence * across
        torque = x.torque + self._period * hand.turning_persistence * angle
        # no integral part in contact
        grows = x.phase == MountingPhase.ALIGN
        return {
            "force": where(grows, limit_magnitude(force, hand.side_limit), share * x.force),
            "torque": where(grows, limit_magnitude(torque, hand.turning_limit), share * x.torque),
            "deepest": where(deeper, depth, x.deepest),
            "when": where(deeper, time, x.when),
        }

    def _next_phase(self, x: Values, time: Any, pose: Any, holding: Any) -> Any:
        """Return the phase after this instant."""
        hand, Phase, depth = self._mounting, MountingPhase, self._depth(pose)
        lasted, still = time - x.since, time - x.when > hand.patience
        is_placed = any_of(self._is_aligned(x, time, pose), lasted > hand.look_time)
        grip, lead, release = Phase.LEAD, Phase.ALIGN, Phase.LEAVE
        if self._returns:
            grip, lead, release = Phase.DONE, Phase.GRIP, Phase.LEAD
        return first_of(
            (all_of(x.phase == Phase.GRIP, holding >= 1.0, lasted >= 0.0), grip),
            (all_of(x.phase == Phase.LEAD, time - x.clock >= self._hand.end), lead),
            (all_of(x.phase == Phase.ALIGN, is_placed), Phase.INSERT),
            (all_of(x.phase == Phase.INSERT, depth > -hand.eye_gap, still), Phase.RELEASE),
            (all_of(x.phase == Phase.RELEASE, lasted > hand.patience), release),
            (all_of(x.phase == Phase.LEAVE, depth < -hand.leave_distance), Phase.DONE),
            otherwise=x.phase,
        )

    def _is_aligned(self, x: Values, time: Any, pose: Any) -> Any:
        hand, across, angle = self._mounting, *self._goal_deviation(x, time, pose)
        near = ca.fabs(self._depth(pose) + self._pin_length + hand.hover) < hand.hover / 2.0
        tolerances = max(hand.eye_error, hand.eye_gap / 2.0), max(hand.eye_angle, 1e-3)
        return all_of(near, ca.norm_2(across) < tolerances[0], ca.norm_2(angle) < tolerances[1])


def _is_placing(x: Values) -> Any:
    return any_of(x.phase == MountingPhase.ALIGN, x.phase == MountingPhase.INSERT)
