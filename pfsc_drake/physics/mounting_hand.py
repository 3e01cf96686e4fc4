"""An operator who takes a plate from a magazine and inserts its pins into the bores of a frame."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from pfsc_drake.blocks.block import Port, Values
from pfsc_drake.blocks.cases import all_finite, all_of, any_of, first_of, where
from pfsc_drake.errors import require
from pfsc_drake.physics.hand_model import HandParameters, limited, orientation
from pfsc_drake.physics.hand_way import Place
from pfsc_drake.physics.operator_hand import OperatorHand
from pfsc_drake.yaml.rules import NotNegative, Parameters, Positive, Seed

TASKS = ("mount", "return")


@dataclass
class MountingHandParameters(Parameters):
    """How an operator mounts a plate.

    Forces by which things are brought into place come from what is seen and felt: the operator
    pushes in proportion to the distance that is seen, and more as long as it lasts, until
    something touches; from then on the hands follow.

    Attributes:
        task: ``mount``: take the plate, lead it to the frame, insert it, let go of it and leave;
            ``return``: let go of a plate in the frame, lead the gripper back, take the next.
        press: Force along the tool's axis while gripping [N].
        reach: How far the hand that leads is ahead of the tool at most [m]; farther on it waits.
        insert: The same while inserting [N].
        leave: The same, backwards, when leaving [N].
        leave_distance: How far [m].
        hover: Gap between pins and frame at which a person stops to look [m].
        eye_error: Standard deviation of where a person sees the bores, along each of two axes
            across them [m]; what is drawn is cut off at twice that.
        eye_angle: The same of their orientation, about each of three axes [rad].
        eye_gap: Gap between plate and frame that is taken for none [m].
        stiffness: Push beside the tool's axis per distance that is seen [N/m].
        persistence: Growth of that push [N/(m s)].
        side_limit: Largest push beside the axis that persistence leads to [N].
        turning_stiffness: Moment per angle that is seen [Nm/rad].
        turning_persistence: Growth of that moment [Nm/(rad s)].
        turning_limit: Largest moment that persistence leads to [Nm].
        search_radius: Radius of the spiral in which the bores are felt for [m].
        search_time: Until the spiral is that wide [s].
        search_period: Duration of one turn of that spiral [s].
        captured: Depth in the bores from which on the hands follow [m].
        relaxation: Time constant with which they then give up what persistence led to [s].
        wobble: Moment by which a plate that sticks is worked in [Nm].
        patience: How long nothing moves until a person tries something else [s].
        look_time: How long a person aligns at most before trying [s].
        seed: Seed of the errors of the eye.
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


_LARGEST_ERROR = 2.0  # standard deviations of what the eye errs by
_NOTHING = ca.DM.zeros(3)


class MountingPhase(IntEnum):
    """What the operator is doing."""

    GRIP = 0
    LEAD = 1
    ALIGN = 2
    INSERT = 3
    RELEASE = 4
    LEAVE = 5
    DONE = 6


class MountingHand(OperatorHand):
    """A hand that mounts a plate, phase by phase.

    The *goal* is the tool's pose when the plate is seated; the operator sees it in a wrong place,
    by what is drawn once per run. The hand leads by its waypoints, as :class:`OperatorHand`; their
    times count from when the plate hangs on the gripper, or from when it has been let go. It sees
    the tool once per period, answers after its reaction delay, trembles, and is limited in force
    as that one is.

    ========  ====================================================================================
    grip      presses along the tool's axis until all cups hold
    lead      follows the waypoints, and waits where the tool stays behind
    align     stops above the bores and brings the plate to where they are seen
    insert    pushes along the axis of the bores; where nothing goes on, feels for them in a
              spiral around where they are seen; once the pins are in, lets the bores lead, and
              works a plate that sticks to and fro
    release   ends the vacuum, and waits
    leave     pulls back
    done      does nothing
    ========  ====================================================================================

    Ports, beside those of :class:`OperatorHand`:
        held (input): Share of the gripper's cups that hold, shape (1,).
        vacuum (output): 1 while it has the vacuum on, shape (1,).
        phase (output): :class:`MountingPhase`, shape (1,).

    State, beside:
        phase, ``since`` when [s], zero of the waypoints' ``clock`` [s], lasting ``force`` [N] and
        ``torque`` [Nm], world axes, ``deepest`` depth [m] and ``when`` it was reached [s].

    Args:
        parameters: Properties of the hand; its waypoints lead.
        mounting: How it goes about.
        goal: Tool point and orientation when the plate is seated, shapes (3,) and (3, 3).
        pin_length: Pin length of the plate [m].
        period: Sampling time [s].
        place: Where the hand pulls to.

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
        place: Place | None = None,
    ) -> None:
        super().__init__(parameters, period, place)
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
        """Return what is remembered at the start; what is left out is zero."""
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
        """Return what is remembered at the next tick; what is left out stays."""
        after = self.following(x, t * self._period, u.tool_pose, u.held)
        sees = all_finite(u.tool_pose)
        after = {name: where(sees, value, getattr(x, name)) for name, value in after.items()}
        return super().update(x, u, y, t) | after

    def wanted(self, x: Values, time: Any, pose: Any, twist: Any) -> Any:
        """Return the wrench that the hand wants, world axes, shape (6,) [N, Nm]."""
        hand, tool_axis = self._mounting, orientation(pose)[:, 2]
        lead = self._hand.wanted(time - x.clock, pose[:3], twist, reach=hand.reach)
        return first_of(
            (x.phase == MountingPhase.LEAD, lead),
            (x.phase == MountingPhase.GRIP, ca.vertcat(hand.press * tool_axis, _NOTHING)),
            (x.phase == MountingPhase.LEAVE, ca.vertcat(-hand.leave * tool_axis, _NOTHING)),
            (_places(x), self._placing(x, time, pose)),
            otherwise=0.0,
        )

    def _placing(self, x: Values, time: Any, pose: Any) -> Any:
        """Return what brings the plate into the bores."""
        hand, across, angle = self._mounting, *self._seen(x, time, pose)
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
        """Return how deep the plate is, negative before it is seated [m]."""
        return ca.dot(self._axis, pose[:3] - self._p)

    def _is_captured(self, x: Values, pose: Any) -> Any:
        depth = self._mounting.captured - self._pin_length
        return all_of(x.phase == MountingPhase.INSERT, self._depth(pose) > depth)

    def _seen(self, x: Values, time: Any, pose: Any) -> tuple[Any, Any]:
        """Return how far across [m] and how much turned [rad] the goal is seen, world axes."""
        away = self._p + self._spiral(x, time) - pose[:3]
        across = away - self._axis * ca.dot(self._axis, away)
        turn = self._R @ orientation(pose).T
        return across, ca.inv_skew((turn - turn.T) / 2.0)

    def _spiral(self, x: Values, time: Any) -> Any:
        """Return where the bores are felt for beside where they are seen [m], shape (3,)."""
        hand = self._mounting
        searching = time - x.since - hand.patience
        radius = hand.search_radius * ca.fmin(searching / hand.search_time, 1.0)
        searches = all_of(x.phase == MountingPhase.INSERT, searching >= 0.0)
        return where(searches, radius * self._circle(searching / hand.search_period), 0.0)

    def _circle(self, turns: Any) -> Any:
        """Return a direction across the axis of the bores after a number of turns, shape (3,)."""
        angle = 2.0 * np.pi * turns
        return self._R @ ca.vertcat(ca.cos(angle), ca.sin(angle), 0.0)

    def following(self, x: Values, time: Any, pose: Any, held: Any) -> dict[str, Any]:
        """Return the operator's states one period later, those of the hand left out.

        Args:
            x: States.
            time: [s].
            pose: ``[y_t, R_e by rows]``, shape (12,).
            held: Share of the cups that hold.
        """
        target, _ = self._hand.target(time - x.clock)
        is_ahead = ca.norm_2(target - pose[:3]) > self._mounting.reach
        waits = all_of(x.phase == MountingPhase.LEAD, is_ahead)
        kept = Values(
            phase=x.phase, since=x.since, clock=x.clock + self._period * waits,
            **self._persisting(x, time, pose),
        )  # fmt: skip
        phase = self._next_phase(kept, time, pose, held)
        begins, leads = phase != x.phase, phase == MountingPhase.LEAD
        return vars(kept) | {
            "phase": phase,
            "since": where(begins, time, kept.since),
            "when": where(begins, time, kept.when),
            "deepest": where(begins, self._depth(pose), kept.deepest),
            "clock": where(all_of(begins, leads), time - self._hand.begin, kept.clock),
        }

    def _persisting(self, x: Values, time: Any, pose: Any) -> dict[str, Any]:
        """Let force and moment grow as long as something is seen to be off, in place."""
        hand, depth = self._mounting, self._depth(pose)
        deeper = all_of(_places(x), depth > x.deepest + hand.eye_gap / 2.0)
        relaxed = 1.0 - min(self._period / hand.relaxation, 1.0)
        share = where(self._is_captured(x, pose), relaxed, 1.0)
        across, angle = self._seen(x, time, pose)
        force = x.force + self._period * hand.persistence * across
        torque = x.torque + self._period * hand.turning_persistence * angle
        # against something that is touched nobody pushes more and more
        grows = x.phase == MountingPhase.ALIGN
        return {
            "force": where(grows, limited(force, hand.side_limit), share * x.force),
            "torque": where(grows, limited(torque, hand.turning_limit), share * x.torque),
            "deepest": where(deeper, depth, x.deepest),
            "when": where(deeper, time, x.when),
        }

    def _next_phase(self, x: Values, time: Any, pose: Any, held: Any) -> Any:
        """Return the phase after this instant."""
        hand, Phase, depth = self._mounting, MountingPhase, self._depth(pose)
        lasted, still = time - x.since, time - x.when > hand.patience
        placed = any_of(self._is_aligned(x, time, pose), lasted > hand.look_time)
        grip, lead, release = Phase.LEAD, Phase.ALIGN, Phase.LEAVE
        if self._returns:
            grip, lead, release = Phase.DONE, Phase.GRIP, Phase.LEAD
        return first_of(
            (all_of(x.phase == Phase.GRIP, held >= 1.0, lasted >= 0.0), grip),
            (all_of(x.phase == Phase.LEAD, time - x.clock >= self._hand.end), lead),
            (all_of(x.phase == Phase.ALIGN, placed), Phase.INSERT),
            (all_of(x.phase == Phase.INSERT, depth > -hand.eye_gap, still), Phase.RELEASE),
            (all_of(x.phase == Phase.RELEASE, lasted > hand.patience), release),
            (all_of(x.phase == Phase.LEAVE, depth < -hand.leave_distance), Phase.DONE),
            otherwise=x.phase,
        )

    def _is_aligned(self, x: Values, time: Any, pose: Any) -> Any:
        hand, across, angle = self._mounting, *self._seen(x, time, pose)
        near = ca.fabs(self._depth(pose) + self._pin_length + hand.hover) < hand.hover / 2.0
        seen = max(hand.eye_error, hand.eye_gap / 2.0), max(hand.eye_angle, 1e-3)
        return all_of(near, ca.norm_2(across) < seen[0], ca.norm_2(angle) < seen[1])


def _places(x: Values) -> Any:
    return any_of(x.phase == MountingPhase.ALIGN, x.phase == MountingPhase.INSERT)
