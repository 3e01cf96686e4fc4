"""An operator who takes a plate from a magazine and inserts its pins into the bores of a frame."""

from enum import IntEnum

import numpy as np
from scipy.spatial.transform import Rotation

from pfsc_drake.physics.hand_model import HandModel
from pfsc_drake.physics.mounting_parameters import MountingHandParameters

_LARGEST_ERROR = 2.0  # standard deviations of what the eye errs by
# parts of the state
_PHASE, _SINCE, _CLOCK, _FORCE, _TORQUE, _DEEPEST, _WHEN = (
    0, 1, 2, slice(3, 6), slice(6, 9), 9, 10
)  # fmt: skip
STATE_SIZE = 11


class MountingPhase(IntEnum):
    """What the operator is doing."""

    GRIP = 0
    LEAD = 1
    ALIGN = 2
    INSERT = 3
    RELEASE = 4
    LEAVE = 5
    DONE = 6


class MountingHand:
    """Force of an operator who mounts a plate, phase by phase.

    The *goal* is the tool's pose when the plate is seated; the operator sees it in a wrong place,
    by what is drawn once per run. ``lead`` is a hand that follows waypoints, see
    :class:`HandModel`; its times count from when the plate hangs on the gripper, or from when it
    has been let go.

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

    The *state*, shape (11,): phase, when it began [s], zero of the waypoints' clock [s], lasting
    force [N] and moment [Nm], world axes, deepest depth [m] and when it was reached [s].

    Args:
        parameters: How it goes about.
        lead: The hand that leads.
        goal_p: Where the tool point is when the plate is seated [m], shape (3,).
        goal_R: Orientation of the tool then, shape (3, 3).
        pin_length: Of the pins [m].
        period: Sampling time [s].
    """

    def __init__(
        self,
        parameters: MountingHandParameters,
        lead: HandModel,
        goal_p: np.ndarray,
        goal_R: np.ndarray,
        pin_length: float,
        period: float,
    ) -> None:
        self._parameters, self._lead = parameters, lead
        self._pin_length, self._period = pin_length, period
        random = np.random.default_rng(parameters.seed)
        errors = np.clip(random.standard_normal(5), -_LARGEST_ERROR, _LARGEST_ERROR)
        across = np.append(parameters.eye_error * errors[:2], 0.0)
        self._p = goal_p + goal_R @ across
        turn = Rotation.from_rotvec(parameters.eye_angle * errors[2:]).as_matrix()
        self._R, self._axis = goal_R @ turn, goal_R[:, 2]

    def start(self) -> np.ndarray:
        """Return the state at the start."""
        state = np.zeros(STATE_SIZE)
        returns = self._parameters.task == "return"
        state[_PHASE] = MountingPhase.RELEASE if returns else MountingPhase.GRIP
        state[_SINCE] = self._lead.begin
        state[_DEEPEST] = -np.inf
        return state

    @staticmethod
    def phase(state: np.ndarray) -> MountingPhase:
        """Return what the operator is doing."""
        return MountingPhase(int(state[_PHASE]))

    def vacuum(self, state: np.ndarray) -> bool:
        """Return whether the operator has the vacuum on."""
        phase, returns = self.phase(state), self._parameters.task == "return"
        if phase is MountingPhase.RELEASE:
            return returns
        if phase is MountingPhase.LEAVE:
            return False
        if phase is MountingPhase.LEAD:
            return not returns
        return phase is not MountingPhase.DONE or returns

    def wanted(
        self, state: np.ndarray, time: float, pose: np.ndarray, twist: np.ndarray
    ) -> np.ndarray:
        """Return force and torque that the operator wants on the tool, world axes, shape (6,).

        Args:
            state: See the class.
            time: [s].
            pose: ``[y_t, R_e by rows]``, shape (12,).
            twist: ``[y_t', w]``, shape (6,).
        """
        phase, hand = self.phase(state), self._parameters
        if phase is MountingPhase.LEAD:
            return self._lead.wanted(time - state[_CLOCK], pose[:3], twist, reach=hand.reach)
        tool_axis = pose[3:].reshape(3, 3)[:, 2]
        if phase is MountingPhase.GRIP:
            return np.concatenate([hand.press * tool_axis, np.zeros(3)])
        if phase is MountingPhase.LEAVE:
            return np.concatenate([-hand.leave * tool_axis, np.zeros(3)])
        if phase in (MountingPhase.ALIGN, MountingPhase.INSERT):
            return self._place(state, time, pose)
        return np.zeros(6)

    def _place(self, state: np.ndarray, time: float, pose: np.ndarray) -> np.ndarray:
        """Return what brings the plate into the bores."""
        hand, across, angle = self._parameters, *self._seen(state, time, pose)
        force, torque = state[_FORCE].copy(), state[_TORQUE].copy()
        if not self._is_captured(state, pose):
            force += hand.stiffness * across
            torque += hand.turning_stiffness * angle
        elif time - state[_WHEN] > hand.patience:
            turn = 2.0 * np.pi * (time - state[_WHEN]) / hand.search_period
            torque += hand.wobble * self._R @ np.array([np.cos(turn), np.sin(turn), 0.0])
        if self.phase(state) is MountingPhase.INSERT:
            return np.concatenate([force + hand.insert * self._axis, torque])
        above = -(self._pin_length + hand.hover) - self._depth(pose)
        along = np.clip(hand.stiffness * above, -hand.insert, hand.insert)
        return np.concatenate([force + along * self._axis, torque])

    def _depth(self, pose: np.ndarray) -> float:
        """Return how deep the plate is, negative before it is seated [m]."""
        return float(self._axis @ (pose[:3] - self._p))

    def _is_captured(self, state: np.ndarray, pose: np.ndarray) -> bool:
        inserting = self.phase(state) is MountingPhase.INSERT
        return inserting and self._depth(pose) > self._parameters.captured - self._pin_length

    def _seen(
        self, state: np.ndarray, time: float, pose: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return how far across [m] and how much turned [rad] the goal is seen, world axes."""
        away = self._p + self._spiral(state, time) - pose[:3]
        across = away - self._axis * (self._axis @ away)
        turn = self._R @ pose[3:].reshape(3, 3).T
        S = (turn - turn.T) / 2.0
        return across, np.array([S[2, 1], S[0, 2], S[1, 0]])

    def _spiral(self, state: np.ndarray, time: float) -> np.ndarray:
        """Return where the bores are felt for beside where they are seen [m], shape (3,)."""
        hand = self._parameters
        searching = time - state[_SINCE] - hand.patience
        if self.phase(state) is not MountingPhase.INSERT or searching < 0.0:
            return np.zeros(3)
        radius = hand.search_radius * min(searching / hand.search_time, 1.0)
        turn = 2.0 * np.pi * searching / hand.search_period
        return radius * self._R @ np.array([np.cos(turn), np.sin(turn), 0.0])

    def step(self, state: np.ndarray, time: float, pose: np.ndarray, held: float) -> np.ndarray:
        """Return the state one period later.

        Args:
            state: See the class.
            time: [s].
            pose: See :meth:`wanted`.
            held: Share of the cups that hold.
        """
        after, phase = state.copy(), self.phase(state)
        if phase in (MountingPhase.ALIGN, MountingPhase.INSERT):
            self._persist(after, time, pose)
        if phase is MountingPhase.LEAD and self._is_ahead(state, time, pose):
            after[_CLOCK] += self._period
        following = self._following(after, time, pose, held)
        if following is not phase:
            after[_PHASE], after[_SINCE], after[_WHEN] = following, time, time
            after[_DEEPEST] = self._depth(pose)
            if following is MountingPhase.LEAD:
                after[_CLOCK] = time - self._lead.begin
        return after

    def _is_ahead(self, state: np.ndarray, time: float, pose: np.ndarray) -> bool:
        target, _ = self._lead.target(time - state[_CLOCK])
        return bool(np.linalg.norm(target - pose[:3]) > self._parameters.reach)

    def _persist(self, state: np.ndarray, time: float, pose: np.ndarray) -> None:
        """Let force and moment grow as long as something is seen to be off, in place."""
        hand, depth = self._parameters, self._depth(pose)
        if depth > state[_DEEPEST] + hand.eye_gap / 2.0:
            state[_DEEPEST], state[_WHEN] = depth, time
        if self._is_captured(state, pose):
            kept = 1.0 - min(self._period / hand.relaxation, 1.0)
            state[_FORCE] *= kept
            state[_TORQUE] *= kept
        if self.phase(state) is not MountingPhase.ALIGN:
            return  # against something that is touched nobody pushes more and more
        across, angle = self._seen(state, time, pose)
        force = state[_FORCE] + self._period * hand.persistence * across
        torque = state[_TORQUE] + self._period * hand.turning_persistence * angle
        state[_FORCE] = _limited(force, hand.side_limit)
        state[_TORQUE] = _limited(torque, hand.turning_limit)

    def _following(
        self, state: np.ndarray, time: float, pose: np.ndarray, held: float
    ) -> MountingPhase:
        """Return the phase after this instant."""
        phase, hand = self.phase(state), self._parameters
        lasted, returns = time - state[_SINCE], hand.task == "return"
        if phase is MountingPhase.GRIP and held >= 1.0 and lasted >= 0.0:
            return MountingPhase.DONE if returns else MountingPhase.LEAD
        if phase is MountingPhase.LEAD and time - state[_CLOCK] >= self._lead.end:
            return MountingPhase.GRIP if returns else MountingPhase.ALIGN
        if phase is MountingPhase.ALIGN and (
            self._is_aligned(state, time, pose) or lasted > hand.look_time
        ):
            return MountingPhase.INSERT
        if (
            phase is MountingPhase.INSERT
            and self._depth(pose) > -hand.eye_gap
            and time - state[_WHEN] > hand.patience
        ):
            return MountingPhase.RELEASE
        if phase is MountingPhase.RELEASE and lasted > hand.patience:
            return MountingPhase.LEAD if returns else MountingPhase.LEAVE
        if phase is MountingPhase.LEAVE and self._depth(pose) < -hand.leave_distance:
            return MountingPhase.DONE
        return phase

    def _is_aligned(self, state: np.ndarray, time: float, pose: np.ndarray) -> bool:
        hand, across, angle = self._parameters, *self._seen(state, time, pose)
        near = abs(self._depth(pose) + self._pin_length + hand.hover) < hand.hover / 2.0
        seen = max(hand.eye_error, hand.eye_gap / 2.0), max(hand.eye_angle, 1e-3)
        return bool(near and np.linalg.norm(across) < seen[0] and np.linalg.norm(angle) < seen[1])


def _limited(vector: np.ndarray, limit: float) -> np.ndarray:
    size = float(np.linalg.norm(vector))
    return vector if size <= limit else vector * (limit / size)
