"""Supervision of joints and drives: implausible measurements, limits, and chatter."""

import math
from dataclasses import dataclass, field
from typing import Annotated, Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import any_of, first_of, is_finite, where
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import MAY_BE_PARAMETRIC, RobotModel, largest_speeds
from pfsc_drake.yaml.rules import NotNegative, Parameters, Range

# 1/s, forgetting rate of differences, and of travel beside a constant position
_FORGETTING, _FORGETTING_RESTS = 20.0, 2.0
# share of the tolerance for a jump within a sample, or a constant value for some samples
_JUMP_SHARE = 0.5
# largest deflection of a spring, relative to that at the drive's limit
_BENDING = 2.0


@dataclass
class SupervisionParameters(Parameters):
    """Parameters of the supervision of joints and drives.

    Attributes:
        tolerance: Largest difference of positions and integrated velocities of a joint [rad or m];
            0 for no comparison.
        resolution: Resolution of the measured positions [rad or m], shape (N,) or one for all;
            widens the tolerance by twice its value.
        filter_time: Delay of measured velocities [s]; widens the tolerance by twice the travel of a
            joint in that time at its present speed.
        joint_limits: Whether a joint at its limit is a fault.
        saturation_time: Longest time of a drive at its limit [s], minus half of the time that it is
            not; 0 for no limit.
        chatter_turns: Number of changes from one limit to the other that is chatter, see
            :class:`~pfsc_drake.control.law.supervision.DriveWatch`; 0 for none.
        overspeed: Tolerated excess of a joint's largest speed, as a share of it; infinite for no
            limit.
    """

    tolerance: NotNegative = 2e-3
    resolution: np.ndarray = field(default_factory=lambda: np.zeros(1))
    filter_time: NotNegative = 0.0
    joint_limits: bool = True
    saturation_time: NotNegative = 0.0
    chatter_turns: NotNegative = 6.0
    overspeed: Annotated[float, Range(0.0, infinite=True)] = 0.1


class Supervision(Block):
    """Detection of inconsistent measurements of joints, and of joints beyond their limits.

    Four signals of every joint describe the same motion: positions and integrated velocities of
    link and motor. From sample to sample each adds to a leaky sum (by 20 1/s), so that offsets
    between them do not count. Position and velocity of one side must agree up to the tolerance;
    both sides up to twice the deflection of the spring at the drive's limit. A velocity with a
    delay ``filter_time`` lags behind by ``filter_time (v - v_m)``, where v_m is
    its mean with the same forgetting: the tolerance is wider by twice the larger of both, each
    up to the speed that is a fault.

    A position must not be constant to the last bit while its integrated velocity exceeds the
    tolerance, with a forgetting rate of 2 1/s: so a frozen position of a slow joint is found, too.

    If position and velocity of one side disagree, the position is suspected if it jumped by half
    the tolerance within this sample, or if it was constant to the last bit while the integrated
    velocity reached half the tolerance; otherwise the velocity. If only the sides disagree, the one
    that has moved less is considered frozen, if it is constant to the last bit. If both sides are
    inconsistent, their velocities are suspected.

    So a position or a velocity that jumps or freezes is found as soon as position and integrated
    velocity differ by the tolerance: a jump of a position in the same sample, a jump of a velocity
    by ``dv`` after ``tolerance / dv``. Not detectable are values that freeze at rest, as long as
    the joint rests, and drifts slower than tolerance times 20 1/s, or 2 1/s beside a constant
    position.

    A joint is too fast if link or motor is, both by its velocity and by its travel since the last
    sample: one of the two alone may be a sensor error, which the comparison above finds.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        ignored (input): Components without comparison, nonzero if so, shape (4N,).
        fault (output): MEASUREMENT_IMPLAUSIBLE, JOINT_LIMIT, JOINT_SPEED or NONE, shape (1,).
        suspects (output): 1 for implausible components of the state, shape (4N,).

    State:
        joint_state of the ``last`` sample, and whether it exists (``known``); the leaky ``sums``
        of the four signals, shape (4N,); the number of samples each value was ``unchanged``, shape
        (4N,); the integrated velocity while the positions of link and motor are constant
        (``unseen``), shape (2N,).

    Args:
        robot: Nominal model of the robot, N joints.
        limits: Limits of the drives' torques [Nm or N], shape (N,).
        parameters: Parameters of the supervision.
        period: Sampling time [s].

    Raises:
        InputError: If the resolution fits another number of joints.
    """

    def __init__(
        self,
        robot: RobotModel,
        limits: np.ndarray,
        parameters: SupervisionParameters,
        period: float,
    ) -> None:
        n = robot.dimension
        resolution = np.asarray(parameters.resolution, dtype=float)
        if resolution.shape not in ((1,), (n,)):
            raise InputError(
                f"resolution: {resolution.tolist()}; must be one number or one of each of {n} "
                "joints"
            )
        self._function = _supervision_function(robot, limits, resolution, parameters, period)
        self.inputs = {
            "joint_state": Port(4 * n, "rad, rad/s or m, m/s"),
            "ignored": Port(4 * n),
        }
        self.outputs = {"fault": Port(1), "suspects": Port(4 * n)}
        self.inner = {"sums": 4 * n, "unchanged": 4 * n, "unseen": 2 * n}
        self.states = {"last": 4 * n, "known": 1} | self.inner

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states; omitted states are zero."""
        return {"last": where(is_finite(u.joint_state), u.joint_state, 0.0)}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        remembered = (x.last, x.sums, x.unchanged, x.unseen, x.known)
        results = self._function(u.joint_state, *remembered, u.ignored)
        return dict(zip(("fault", "suspects", *self.inner), results, strict=True))

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the next states; omitted states do not change."""
        later = {name: getattr(y, name) for name in self.inner}
        return {"last": u.joint_state, "known": 1.0} | later


@once_per_content()
def _supervision_function(
    robot: RobotModel,
    limits: np.ndarray,
    resolution: np.ndarray,
    parameters: SupervisionParameters,
    period: float,
) -> ca.Function:
    """Return ``(state, last, sums, unchanged, unseen, known, ignored) -> (fault, suspects, ..)``.

    The last three results are the next sums, unchanged and unseen.
    """
    n = robot.dimension
    names = ("state", "last", "sums", "unchanged")
    state, last, total, steady = (ca.SX.sym(name, 4 * n) for name in names)
    known, ignored = ca.SX.sym("known"), ca.SX.sym("ignored", 4 * n)
    hidden = ca.SX.sym("unseen", 2 * n)
    bending = robot.elastic_joints * _BENDING * np.minimum(limits, 1e300) / robot.K_s
    now, before, sums = (ca.vertsplit(x, n) for x in (state, last, total))
    unchanged = where(state == last, steady + known, 0.0)
    rests = ca.vertsplit(unchanged, n)
    ways, steps = [], []
    for k, (x, x_0, travel) in enumerate(zip(now, before, sums, strict=True)):
        step = x - x_0 if k % 2 == 0 else period / 2.0 * (x + x_0)
        steps.append(where(known, step, 0.0))
        moved = travel + steps[-1]
        # NaN and infinity count as no motion
        ways.append(where(is_finite(moved), moved, 0.0))
    used = [
        ca.logic_and(is_finite(x), skip == 0.0)
        for x, skip in zip(now, ca.vertsplit(ignored, n), strict=True)
    ]
    allowed = largest_speeds(robot) * (1.0 + parameters.overspeed)
    tolerances, unseen, overlooked = [], [], []
    for side, travel in zip((0, 2), ca.vertsplit(hidden, n), strict=True):
        fast = ca.fmin(_recent_speed(now[side + 1], ways[side + 1]), allowed)
        late = parameters.filter_time * fast
        tolerances.append(parameters.tolerance + 2.0 * (late + resolution))
        further = np.exp(-_FORGETTING_RESTS * period) * travel + steps[side + 1]
        rest = ca.logic_and(rests[side] > 0, used[side + 1])
        unseen.append(where(ca.logic_and(rest, is_finite(further)), further, 0.0))
        overlooked.append(ca.fabs(unseen[-1]) > tolerances[-1])
    q_J, v_J, q_M, v_M = _substitute(ways, used)
    wrong_J = ca.logic_or(ca.fabs(q_J - v_J) > tolerances[0], overlooked[0])
    wrong_M = ca.logic_or(ca.fabs(q_M - v_M) > tolerances[1], overlooked[1])
    link, motor = (q_J + v_J) / 2.0, (q_M + v_M) / 2.0
    apart = ca.fabs(link - motor) > ca.fmax(*tolerances) + bending
    neither, both = ca.logic_not(wrong_J + wrong_M), wrong_J * wrong_M
    link_moved_less = ca.fabs(link) < ca.fabs(motor)
    less = (link_moved_less, 1 - link_moved_less)
    suspects = []
    for side, wrong in ((0, wrong_J), (2, wrong_M)):
        slip, change = steps[side] - steps[side + 1], now[side + 1] - before[side + 1]
        jump = _JUMP_SHARE * tolerances[side // 2]
        # a velocity that jumped also caused differences in the samples before
        agreed = ca.fabs(sums[side] - sums[side + 1]) < jump / 2.0
        sudden = period * ca.fabs(change) < ca.fabs(slip)
        jumped = (ca.fabs(slip) > jump) * agreed * sudden
        rested = period * rests[side] * ca.fabs(now[side + 1]) > jump
        of_position = (1 - both) * ca.fmax(ca.fmax(jumped, rested), overlooked[side // 2])
        suspects += [wrong * of_position, wrong * (1 - of_position)]
    # excessively deflected joints move on both sides
    still = [(rests[side] > 0) * (rests[side + 1] > 0) for side in (0, 2)]
    frozen = [
        neither * apart * moved_less * rest for moved_less, rest in zip(less, still, strict=True)
    ]
    suspect = ca.vertcat(*[s + frozen[k // 2] for k, s in enumerate(suspects)])
    suspect = suspect if parameters.tolerance else 0.0 * suspect
    suspect *= ca.vertcat(*used)
    lower, upper = robot.gather("position_limits").T
    at_limit = ca.sum1((now[0] <= lower) + (now[0] >= upper)) if parameters.joint_limits else 0
    # a difference of positions is as coarse as they are
    fastest = allowed + 2.0 * resolution / period
    speeds = [ca.fmin(ca.fabs(steps[side]) / period, ca.fabs(now[side + 1])) for side in (0, 2)]
    too_fast = ca.sum1((speeds[0] > fastest) + (speeds[1] > fastest))
    fault = first_of(
        (any_of(suspect), Fault.MEASUREMENT_IMPLAUSIBLE),
        (at_limit > 0, Fault.JOINT_LIMIT),
        (too_fast > 0, Fault.JOINT_SPEED),
        otherwise=Fault.NONE,
    )
    decay = np.exp(-_FORGETTING * period)
    sums = ca.vertcat(*[decay * travel for travel in ways])
    results = [fault, suspect, sums, unchanged, ca.vertcat(*unseen)]
    return ca.Function(
        "supervision",
        [state, last, total, steady, hidden, known, ignored],
        ca.cse([ca.densify(ca.SX(result)) for result in results]),
        [*names, "unseen", "known", "ignored"],
        ["fault", "suspects", "next_sums", "next_unchanged", "next_unseen"],
        MAY_BE_PARAMETRIC,
    )


def _recent_speed(v: ca.SX, travel: ca.SX) -> ca.SX:
    """Return the present or recent speed of joints, shape (N,).

    Args:
        v: Velocities, shape (N,); NaN and infinity count as 0.
        travel: Their leaky sums, shape (N,).
    """
    return ca.fmax(where(is_finite(v), ca.fabs(v), 0.0), _FORGETTING * ca.fabs(travel))


def _substitute(ways: list[ca.SX], used: list[ca.SX]) -> list[ca.SX]:
    """Return four signals, each (N,), with unused ones replaced by their side or the other one."""
    means = []
    for side in (0, 2):
        count = used[side] + used[side + 1]
        total = ways[side] * used[side] + ways[side + 1] * used[side + 1]
        means.append((count, total / ca.fmax(count, 1.0)))
    (has_link, link), (has_motor, motor) = means
    link, motor = where(has_link, link, motor), where(has_motor, motor, link)
    return [where(used[k], ways[k], link if k < 2 else motor) for k in range(4)]


# s, time constant of the number of turns
DRIVE_MEMORY = 0.2
# samples at a limit that one sample within the limits compensates
_FORGIVEN = 0.5


class DriveWatch(Block):
    """Detection of drives at their limits for too long, or alternating between them.

    Saturation: each drive's samples at a limit are counted, minus half of the samples within the
    limits. So drives that alternate between the limits are found as well.

    Chatter: a loop that is unstable near its sampling frequency demands growing torque until the
    drives alternate between their limits: the motion stays bounded, and no drive is at one limit
    for long. So changes from one limit to the other are counted; in between, a drive may be
    anywhere. The number is forgotten with a time constant of 0.2 s, so that a drive that oscillates
    at f Hz finally counts ``0.4 f``, beyond ``chatter_turns`` for all f above
    ``2.5 chatter_turns`` Hz. A reversal at full torque, even with an overshoot, has one or two
    changes.

    Ports:
        drive (input): Commands to the drives, shape (N,).
        stopping (input): Nonzero for commands after a fault, which do not count, shape (1,).
        fault (output): DRIVE_SATURATED, DRIVE_CHATTERS or NONE, shape (1,), of the samples
            before: it depends on the state alone.

    State:
        For each drive: ``ticks`` at a limit; ``side`` of its last limit, -1, 0 or 1; its
        ``turns``, each of shape (N,).

    Args:
        limits: Limits of the commands, shape (N,).
        parameters: Parameters of the supervision.
        period: Sampling time [s].
    """

    def __init__(
        self, limits: np.ndarray, parameters: SupervisionParameters, period: float
    ) -> None:
        n, time = len(limits), parameters.saturation_time
        self._limits = ca.DM(np.asarray(limits, dtype=float))
        self._ticks = round(time / period) if time else math.inf
        self._turns = parameters.chatter_turns or math.inf
        self._decay = math.exp(-period / DRIVE_MEMORY)
        self.inputs = {"drive": Port(n), "stopping": Port(1)}
        self.outputs = {"fault": Port(1)}
        self.states = {"ticks": n, "side": n, "turns": n}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        fault = first_of(
            (any_of(x.ticks >= self._ticks), Fault.DRIVE_SATURATED),
            (any_of(x.turns >= self._turns), Fault.DRIVE_CHATTERS),
            otherwise=Fault.NONE,
        )
        return {"fault": fault}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the next states; omitted states do not change."""
        at_limit = ca.fabs(u.drive) >= self._limits
        side = where(at_limit, ca.sign(u.drive), 0.0)
        counted = {
            "ticks": where(at_limit, x.ticks + 1.0, ca.fmax(x.ticks - _FORGIVEN, 0.0)),
            "side": where(side, side, x.side),
            "turns": self._decay * x.turns + (side * x.side < 0.0),
        }
        return {name: where(u.stopping, getattr(x, name), new) for name, new in counted.items()}
