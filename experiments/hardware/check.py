"""Limits of a driven robot, and checks before it moves."""

import time
from dataclasses import replace

import numpy as np

from pfsc_drake.drivers.link import ControllerEndpoint
from pfsc_drake.drivers.messages import ControlMode, RobotMode, RobotStatus
from pfsc_drake.errors import InputError

AT_REST = 0.01  # rad/s or m/s
AT_START = 0.02  # rad or m
# longest time without status [s], and number of consecutive missing ones that are bridged
SILENCE, BRIDGED = 0.1, 10
# longest stop, after which commands end, and rest before that [s]
LONGEST_STOP, RESTED_FOR = 2.0, 0.2
# a failed stop exceeds a multiple of the initial speed plus an offset [rad/s]
STOP_FACTOR, STOP_SPEED = 1.5, 0.2
# jump of a position: factor of the largest speed, default largest speed, and noise
TWICE, FASTEST, LEAST_JUMP = 2.0, 10.0, 2e-3
# a larger gap is a change of the robot's clock [s]
LARGEST_GAP = 1.0
FOREIGN = "another sender commands the robot"
_LISTENED, _FOREIGN = 0.5, 0.1  # s


def check_first(status: RobotStatus, mode: ControlMode, start: np.ndarray) -> None:
    """Reject a robot that is not the scenario's, at rest at its start.

    Args:
        status: The robot's first status.
        mode: Kind of the law's commands.
        start: Joint coordinates at the start, shape (N,).

    Raises:
        InputError: With the actual and the required value.
    """
    check_ready(status, mode, len(start))
    off = status.q - start
    farthest = int(np.abs(off).argmax())
    if abs(off[farthest]) > AT_START:
        raise InputError(
            f"joint {farthest + 1} is at {np.rad2deg(status.q[farthest]):.2f} deg, "
            f"{np.rad2deg(off[farthest]):.2f} deg from the scenario's start; move the robot "
            f"to within {np.rad2deg(AT_START):.1f} deg of "
            f"{np.round(np.rad2deg(start), 2).tolist()} deg, with its own tools"
        )


def check_ready(status: RobotStatus, mode: ControlMode, count: int) -> None:
    """Reject a robot that cannot be driven, is a different one, or moves.

    Args:
        status: Its status.
        mode: Kind of the commands.
        count: Number of joints of the scenario's robot.

    Raises:
        InputError: With the actual and the required value.
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
    check_joints(status, count)
    for what, values in (("positions", status.q), ("velocities", status.v)):
        if not np.isfinite(values).all():
            raise InputError(f"the robot's {what} are not finite: {values.tolist()}")
    fastest = int(np.abs(status.v).argmax())
    if abs(status.v[fastest]) > AT_REST:
        raise InputError(
            f"the robot moves: joint {fastest + 1} at {status.v[fastest]:.3g} rad/s; it must "
            f"rest within {AT_REST:g}"
        )


def check_joints(status: RobotStatus, count: int) -> None:
    """Reject a robot with another number of joints.

    Args:
        status: Its status.
        count: Number of joints of the scenario's robot.

    Raises:
        InputError: If it has another number.
    """
    if len(status.q) != count:
        raise InputError(f"the robot has {len(status.q)} joints; the scenario's has {count}")


def check_alone(end: ControllerEndpoint) -> None:
    """Reject a robot with commands from another sender.

    Args:
        end: The link.

    Raises:
        InputError: If commands of another sender are received within 0.1 s.
    """
    end.receive(0.0)  # discard old messages
    end.foreign, until = 0, time.monotonic() + _FOREIGN
    while (left := until - time.monotonic()) > 0.0:
        end.receive(left)
    if end.foreign:
        raise InputError(
            f"{FOREIGN}: {end.foreign} commands on {end.dialect.command_channel} within "
            f"{_FOREIGN:g} s; end the other sender first"
        )


def listen(end: ControllerEndpoint, period: float) -> RobotStatus:
    """Return the mean status of a robot at rest over half a second.

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
