"""What is checked of a robot before anything moves, and what its torques at rest say."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from pfsc_drake.drivers.link import ControllerEnd
from pfsc_drake.drivers.messages import ControlMode, RobotMode, RobotStatus
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import gravity_function
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.singular_posture import tool_jacobian

AT_REST = 0.01  # rad/s or m/s
AT_START = 0.02  # rad or m
_LISTENED = 0.5  # s
# of the largest weight in a joint: differences that friction and sensors leave
_NOTHING = 0.02
# share of the difference that a single cause must explain
_EXPLAINED = 0.9
_ITERATIONS = 5
_LARGEST_ZERO = 45.0  # deg


@dataclass(frozen=True)
class Cause:
    """Something that may be wrong.

    Attributes:
        words: What.
        left: Share of the difference that it leaves, 0 to 1.
        unknowns: How many numbers were chosen for it.
    """

    words: str
    left: float
    unknowns: int


@dataclass(frozen=True)
class RestCheck:
    """Torques of a robot at rest.

    Attributes:
        q: Its posture [rad or m], shape (N,).
        measured: What it measures [Nm or N], shape (N,).
        expected: What the model says, shape (N,).
        causes: What may be wrong, the likeliest first; none if nothing is.
    """

    q: np.ndarray
    measured: np.ndarray
    expected: np.ndarray
    causes: list[Cause]

    @property
    def is_good(self) -> bool:
        """Whether both agree."""
        return not self.causes

    @property
    def verdict(self) -> str:
        """One sentence."""
        if self.is_good:
            return "the robot's torques at rest are those of the model"
        likely = [cause for cause in self.causes if cause.left < 1.0 - _EXPLAINED]
        if not likely:
            return "no single cause explains the difference; look at friction, and at the model"
        best = likely[0]
        others = [cause.words for cause in likely[1:3] if cause.left < 2.0 * best.left + 1e-3]
        also = f"; as well may be: {', or '.join(others)}" if others else ""
        return (
            f"most likely {best.words}: it explains {1.0 - best.left:.1%} of the difference{also}"
        )


def check_first(status: RobotStatus, mode: ControlMode, start: np.ndarray) -> None:
    """Refuse a robot that is not that of a scenario, at rest at its start.

    Args:
        status: The robot's first status.
        mode: What the law commands.
        start: Joint coordinates at the start, shape (N,).

    Raises:
        InputError: One line that says what is, and what must be.
    """
    if status.robot_mode is not RobotMode.MOVE:
        raise InputError(
            f"the robot is in mode {status.robot_mode.name}; it must be in MOVE to be driven"
        )
    if status.control_mode not in (ControlMode.NONE, mode):
        raise InputError(
            f"the robot's driver is in {status.control_mode.name} mode; the law needs "
            f"{mode.name}: start the driver so, or choose another controller.law"
        )
    _check_joints(status, len(start))
    for what, values in (("positions", status.q), ("velocities", status.v)):
        if not np.isfinite(values).all():
            raise InputError(f"the robot's {what} are not finite: {values.tolist()}")
    fastest = int(np.abs(status.v).argmax())
    if abs(status.v[fastest]) > AT_REST:
        raise InputError(
            f"the robot moves: joint {fastest + 1} at {status.v[fastest]:.3g} rad/s; it must "
            f"rest within {AT_REST:g}"
        )
    off = status.q - start
    farthest = int(np.abs(off).argmax())
    if abs(off[farthest]) > AT_START:
        raise InputError(
            f"joint {farthest + 1} is at {np.rad2deg(status.q[farthest]):.2f} deg, "
            f"{np.rad2deg(off[farthest]):.2f} deg from the scenario's start; move the robot "
            f"to within {np.rad2deg(AT_START):.1f} deg of "
            f"{np.round(np.rad2deg(start), 2).tolist()} deg, with its own tools"
        )


def _check_joints(status: RobotStatus, count: int) -> None:
    if len(status.q) != count:
        raise InputError(f"the robot has {len(status.q)} joints; the scenario's has {count}")


def listen(end: ControllerEnd, period: float) -> RobotStatus:
    """Return the mean of what a robot at rest tells for half a second.

    Args:
        end: The link.
        period: Sampling time of the robot [s].

    Raises:
        InputError: If no status comes, or the robot moves.
    """
    heard: list[RobotStatus] = []
    for _ in range(round(_LISTENED / period)):
        status = end.receive(1.0)
        if status is None:
            break
        heard.append(status)
    if not heard:
        raise InputError(
            f"no status of a robot on {end.dialect.status_channel}; is its driver running, on the "
            "same --lcm and --driver?"
        )
    fastest = max(float(np.abs(status.v).max()) for status in heard)
    if not fastest <= AT_REST:
        raise InputError(f"the robot moves at {fastest:.3g} rad/s; it must rest within {AT_REST:g}")
    means = [np.mean([getattr(s, name) for s in heard], axis=0) for name in ("q", "v", "torque")]
    return replace(heard[-1], q=means[0], v=means[1], torque=means[2])


def check_at_rest(robot: SerialChain, status: RobotStatus) -> RestCheck:
    """Compare what a robot measures at rest with what is believed of it.

    Args:
        robot: The robot as it is believed, N joints.
        status: What it tells.

    Raises:
        InputError: If it has another number of joints.
    """
    _check_joints(status, robot.dimension)
    expected = gravity_function(robot)(status.q).full().ravel()
    missing = status.torque - expected
    largest = max(float(np.abs(expected).max()), 1e-9)
    if np.abs(missing).max() <= _NOTHING * largest:
        return RestCheck(status.q, status.torque, expected, [])
    causes = sorted(_causes(robot, status, expected, missing), key=lambda c: (c.left, c.unknowns))
    # more numbers explain more: they are the cause only where one number does not do
    single = [cause for cause in causes if cause.unknowns == 1 and cause.left < 1.0 - _EXPLAINED]
    causes = [*single, *(cause for cause in causes if cause not in single)]
    return RestCheck(status.q, status.torque, expected, causes)


def _causes(
    robot: SerialChain, status: RobotStatus, expected: np.ndarray, missing: np.ndarray
) -> Iterator[Cause]:
    """Return all that may be wrong, each with what it leaves unexplained."""
    size = float(np.linalg.norm(missing))
    for i in range(len(expected)):
        flipped = missing.copy()
        flipped[i] = -status.torque[i] - expected[i]
        yield Cause(
            f"the torque of joint {i + 1} has the wrong sign",
            float(np.linalg.norm(flipped) / size),
            1,
        )
    q = ca.SX.sym("q", len(expected))
    weight = gravity_function(robot)
    slope = ca.Function("slope", [q], [ca.jacobian(weight(q), q)])
    for i in range(len(expected)):
        # the joint is where the weight says, not where it tells
        there = status.q.copy()
        for _ in range(_ITERATIONS):
            column = np.asarray(slope(there))[:, i]
            if not np.any(column):
                break
            rest = status.torque - np.asarray(weight(there)).ravel()
            there[i] += float(column @ rest / (column @ column))
        left = np.linalg.norm(status.torque - np.asarray(weight(there)).ravel()) / size
        off = np.rad2deg(status.q[i] - there[i])
        if abs(off) < _LARGEST_ZERO:
            yield Cause(f"the zero of joint {i + 1} is off by {off:.2f} deg", float(left), 1)
    J = ca.Function("J", [q], [tool_jacobian(robot, q)])(status.q).full()[:3]
    column = -J.T @ robot.gravity
    if np.any(column):
        mass = float(column @ missing / (column @ column))
        left = np.linalg.norm(missing - mass * column) / size
        kind = "more" if mass > 0.0 else "less"
        yield Cause(f"the tool weighs {abs(mass):.2f} kg {kind} than is told", float(left), 1)
    axes = [gravity_function(replace(robot, gravity=axis))(status.q).full() for axis in np.eye(3)]
    columns = np.hstack(axes)
    gravity = np.linalg.lstsq(columns, status.torque, rcond=1e-6)[0]
    left = np.linalg.norm(status.torque - columns @ gravity) / size
    words = f"gravity is {np.round(gravity, 2).tolist()} m/s^2 in the robot's world"
    yield Cause(f"{words}, not {np.round(robot.gravity, 2).tolist()}", float(left), 3)
