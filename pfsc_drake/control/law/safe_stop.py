"""Safe state of the drives: controlled stop, and hold at rest."""

import enum
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_of, is_finite, where
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.law.stopping_step import (
    UNHELD,
    Joints,
    StopMemory,
    inverse_dynamics,
    stopping_step,
)
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel

# s, of the shortest stop
_SHORTEST = 0.05
# largest slope of smoothstep over its mean
_PEAK = 1.5
# least share of the torque limit for braking, independent of gravity
_LEAST_SHARE = 0.1
# s, from the planned end of a stop until brakes are requested
_SETTLING = 0.2


class StopCategory(enum.IntEnum):
    """Stop category of IEC 60204-1 that a controller requests."""

    NONE = -1
    BRAKES = 0
    CONTROLLED = 1
    HOLD = 2

    @property
    def explanation(self) -> str:
        """Explanation in one phrase."""
        return _CATEGORIES[self]


_CATEGORIES = {
    StopCategory.NONE: "no stop",
    StopCategory.BRAKES: "close the brakes now, and switch the power off once they hold",
    StopCategory.CONTROLLED: "controlled stop, then brakes",
    StopCategory.HOLD: "controlled stop, held by the drives",
}


@dataclass(frozen=True)
class SafeState:
    """Parameters of stop and hold, see :class:`SafeStop`.

    Attributes:
        damping: Least damping of every drive [Nm s/rad], shape (N,).
        bandwidth: ``omega`` of the position hold [rad/s].
        effort_share: Share of the drives' limits for planned braking, up to 1.
        has_brakes: Whether the robot has holding brakes, which are requested after the stop.
    """

    damping: np.ndarray
    bandwidth: float = 60.0
    effort_share: float = 0.7
    has_brakes: bool = False

    def check(self, num_joints: int) -> None:
        """Refuse parameters out of range.

        Args:
            num_joints: N.

        Raises:
            InputError: If a parameter is out of range.
        """
        damping = np.asarray(self.damping)
        if damping.shape != (num_joints,) or not np.all((damping >= 0.0) & np.isfinite(damping)):
            raise InputError(
                f"safe state damping: {self.damping}; must be {num_joints} finite numbers, "
                "none negative"
            )
        if not 0.0 < self.bandwidth < np.inf:
            raise InputError(f"safe state bandwidth: {self.bandwidth}; must be positive and finite")
        if not 0.0 < self.effort_share <= 1.0:
            raise InputError(
                f"safe state effort share: {self.effort_share}; must be above 0, at most 1"
            )


class SafeStop(Block):
    """Controlled stop along a joint trajectory, and hold at its end.

    From the state at the fault all joints slow down in proportion, ``q_J,r' = v_0 s'(t)`` with
    ``s'`` from 1 to 0 in the time T that the drives need for the momentum ``p = (D_E + D_M) v_0``
    beside the weight. The drives get::

        tau_d = tau_J + D_M a_r + d v_r + K_p (q_M,r - q_M) + K_v (v_M,r - v_M)
        tau_J = D_E a_r + n_E,   q_M,r = q_J,r + tau_J / K_s + (its error at the fault) s'

    by the nominal model, ``K_p = D omega^2``, ``K_v = 2 D omega`` of the joint's whole inertia D,
    within the limits of sampling and up to ``sqrt(K_s (D - D_M))``, where oscillations of the
    springs decay fastest. At rest it is (constant) gravity compensation and a PD law on the
    motors, which is stable for rigid and elastic joints alike; the torque is continuous at the end
    of the motion.

    Each joint is held by its remaining measurements. If the motor's position is lost, its
    velocity is integrated and corrected by the link's position; if its velocity is lost, the
    position is differentiated; for a rigid joint either side suffices. If only the link of an
    elastic joint is measured, the motor is simulated, on its spring and with some damping, and half
    the gains act on it. A joint without any measurement gets ``tau_J`` alone: its weight is
    compensated, but only a brake holds it. A value that is NaN or infinite is used again when it
    returns; an implausible one is not.

    ``stop_category`` follows IEC 60204-1: 1 during a stop of a robot with brakes, 2 without
    brakes, held by the drives; 0 requests the brakes immediately: 0.2 s after the planned end of
    the stop if there are brakes, and in any case after 50 ms without any measurement of a joint.
    The drives stay active, also while brakes hold.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        fault (input): Nonzero from the fault on, shape (1,).
        suspects (input): Implausible components of the state, nonzero if so, shape (4N,).
        torque (output): Torques of the drives, within their limits, shape (N,) [Nm or N]; zero
            without a fault.
        stop_category (output): A :class:`StopCategory`, shape (1,), -1 without a fault.
        ignored (output): Components of the joint state that are no longer used, nonzero if so,
            shape (4N,). It depends on the state alone.

    State:
        Whether the robot is ``stopping``, and the fields of :class:`StopMemory`; without a fault
        only the last state.

    Args:
        robot: Nominal model of the robot, N joints.
        limits: Magnitude limits of the drives, shape (N,) [Nm or N].
        settings: Parameters of stop and hold.
        period: Sampling time [s].

    Raises:
        InputError: If the settings are out of range.
    """

    expands = False

    def __init__(
        self, robot: RobotModel, limits: np.ndarray, settings: SafeState, period: float
    ) -> None:
        settings.check(robot.dimension)
        # the stop does not depend on symbolic parameters
        n, robot = robot.dimension, robot.numeric
        joints = Joints.of(robot, np.asarray(limits), settings.damping)
        self._start = starting_function(robot, joints, settings.effort_share, period)
        self._step = stopping_step(robot, joints, settings.bandwidth, period)
        self._has_brakes = settings.has_brakes
        self._sizes = StopMemory.sizes(n)
        self.inputs = {
            "joint_state": Port(4 * n, "rad, rad/s or m, m/s"),
            "fault": Port(1),
            "suspects": Port(4 * n),
        }
        self.outputs = {
            "torque": Port(n, "Nm or N"),
            "stop_category": Port(1),
            "ignored": Port(4 * n),
        }
        self.inner = {"later": sum(self._sizes.values())}
        self.states = {"stopping": 1} | self._sizes

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states; omitted states are zero."""
        return {"last": where(is_finite(u.joint_state), u.joint_state, 0.0)}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        before = StopMemory(*[getattr(x, name) for name in self._sizes])
        fresh = ca.vertcat(*self._start(x.last, u.joint_state, u.suspects))
        memory = ca.if_else(x.stopping, ca.vertcat(*before), fresh, True)
        parts = self._split(memory)
        stop = ca.vertcat(*self._step(*parts.values(), u.joint_state, u.suspects))
        n = self.outputs["torque"].size
        idle = ca.vertcat(ca.DM(n, 1), *before._replace(last=u.joint_state))
        torque, later = ca.vertsplit(ca.if_else(u.fault, stop, idle, True), [0, n, stop.numel()])
        return {
            "torque": torque,
            "stop_category": self._category(u.fault, x.stopping, before),
            "ignored": x.ignored,
            "later": later,
        }

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the next states; omitted states do not change."""
        return {"stopping": u.fault != 0.0} | self._split(y.later)

    def _category(self, fault: Any, stopping: Any, memory: StopMemory) -> Any:
        """Return the stop category from the memory of the stop."""
        controlled = StopCategory.CONTROLLED if self._has_brakes else StopCategory.HOLD
        due = memory.unheld >= UNHELD
        if self._has_brakes:
            due = ca.logic_or(due, memory.elapsed >= memory.duration + _SETTLING)
        brakes = all_of(stopping, due)
        category = where(brakes, float(StopCategory.BRAKES), float(controlled))
        return where(fault, category, float(StopCategory.NONE))

    def _split(self, memory: Any) -> dict[str, Any]:
        """Return the parts of a memory by name."""
        ends = np.cumsum([0, *self._sizes.values()]).tolist()
        return dict(zip(self._sizes, ca.vertsplit(memory, ends), strict=True))


@once_per_content()
def starting_function(
    robot: RobotModel, joints: Joints, effort_share: float, period: float
) -> ca.Function:
    """Return ``(last, state, suspects) -> (elapsed, .., last)`` at the instant of a fault.

    The results are the fields of :class:`StopMemory`; ``last`` is the state one period before, as
    far as known, ``state`` is measured now, and ``suspects`` marks its implausible components,
    nonzero if so, each (4N,).

    Args:
        robot: Nominal model of the robot, N joints.
        joints: Constants of its joints.
        effort_share: Share of the drives' limits for planned braking, up to 1.
        period: Sampling time [s].
    """
    n = robot.dimension
    zero = ca.SX.zeros(n)
    last, state, suspects = (ca.SX.sym(name, 4 * n) for name in ("last", "state", "suspects"))

    def deflection(q: ca.SX) -> ca.SX:
        return inverse_dynamics(robot, q, zero, zero) * joints.compliance

    q_J, v_J, q_M, v_M = _state_at_fault(last, state, suspects != 0.0, deflection, period)
    D = robot.mass_matrix(q_J) + ca.diag(joints.D_M)
    weight = inverse_dynamics(robot, q_J, zero, zero)
    memory = StopMemory(
        elapsed=ca.SX(1, 1),
        duration=_stopping_time(D @ v_J, weight, joints.limits, effort_share),
        q_0=q_J,
        v_0=v_J,
        offset=q_M - (q_J + inverse_dynamics(robot, q_J, v_J, zero) * joints.compliance),
        offset_rate=v_M - v_J,
        inertia=ca.diag(D),
        position=q_M,
        rate=v_M,
        unheld=ca.SX(1, 1),
        ignored=suspects,
        last=state,
    )
    return ca.Function(
        "starting_stop",
        [last, state, suspects],
        ca.cse([ca.densify(x) for x in memory]),
        ["last", "state", "suspects"],
        [f"next_{name}" for name in memory._fields],
    )


def _state_at_fault(
    last: ca.SX,
    state: ca.SX,
    suspects: ca.SX,
    deflection: Callable[[ca.SX], ca.SX],
    period: float,
) -> list[ca.SX]:
    """Return ``q_J, v_J, q_M, v_M``, each (N,), from the measurement or the sample before."""
    n = state.shape[0] // 4
    now, suspect = ca.vertsplit(state, n), ca.vertsplit(suspects, n)
    before = ca.vertsplit(where(is_finite(last), last, 0.0), n)
    good = [ca.logic_and(is_finite(x), ca.logic_not(s)) for x, s in zip(now, suspect, strict=True)]
    expected = [
        before[0] + period * before[1],
        before[1],
        before[2] + period * before[3],
        before[3],
    ]
    found = [where(ok, x, e) for ok, x, e in zip(good, now, expected, strict=True)]
    only = [ca.logic_and(suspect[k], ca.logic_not(suspect[(k + 2) % 4])) for k in range(4)]
    # an implausible value may have been wrong for a while: the other side is better
    bend = deflection(where(only[0], found[2], found[0]))
    found[0] = where(only[0], found[2] - bend, found[0])
    found[2] = where(only[2], found[0] + bend, found[2])
    for own in (1, 3):
        position, other = own - 1, (own + 2) % 4
        quotient = (now[position] - before[position]) / period
        known = where(good[position], quotient, 0.0)
        found[own] = where(suspect[own], where(only[own], found[other], known), found[own])
    return found


def _stopping_time(momentum: ca.SX, weight: ca.SX, limits: ca.DM, effort_share: float) -> ca.SX:
    """Return the time T [s] in which the drives can stop the momentum beside the weight."""
    # the weight helps to brake upward motion
    granted = effort_share * limits + ca.sign(momentum) * weight
    available = ca.fmax(granted, _LEAST_SHARE * limits)
    return ca.fmax(_SHORTEST, ca.mmax(_PEAK * ca.fabs(momentum) / available))
