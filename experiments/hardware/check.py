"""Limits of a drive, and the checks of a robot before anything moves."""

import time
from dataclasses import replace

import numpy as np

from pfsc_drake.drivers.link import ControllerEnd
from pfsc_drake.drivers.messages import ControlMode, RobotMode, RobotStatus
from pfsc_drake.errors import InputError

AT_REST = 0.01  # rad/s or m/s
AT_START = 0.02  # rad or m
# how long no status may come [s], and how many may be missing in a row and are made up for
SILENCE, BRIDGED = 0.1, 10
# after which a robot that is to stop is left alone, and how long it rests before [s]
LONGEST_STOP, RESTED_FOR = 2.0, 0.2
# a stop that makes the robot faster than this is none: a multiple of its speed, and more [rad/s]
STOP_FACTOR, STOP_SPEED = 1.5, 0.2
# beyond what a joint can move: a multiple of its speed, that of unknown ones, and noise
TWICE, FASTEST, LEAST_JUMP = 2.0, 10.0, 2e-3
# ticks that are missing for longer are none of a robot's: its clock was set [s]
LARGEST_GAP = 1.0
FOREIGN = "another sender commands the robot"
_LISTENED, _FOREIGN = 0.5, 0.1  # s


def check_first(status: RobotStatus, mode: ControlMode, start: np.ndarray) -> None:
    """Refuse a robot that is not that of a scenario, at rest at its start.

    Args:
        status: The robot's first status.
        mode: What the law commands.
        start: Joint coordinates at the start, shape (N,).

    Raises:
        InputError: One line that says what is, and what must be.
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
    """Refuse a robot that cannot be driven, is another one, or moves.

    Args:
        status: What it tells.
        mode: What it is to be commanded by.
        count: How many joints the scenario's robot has.

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
    """Refuse a robot with another number of joints.

    Args:
        status: What it tells.
        count: How many joints the scenario's robot has.

    Raises:
        InputError: If it has another number.
    """
    if len(status.q) != count:
        raise InputError(f"the robot has {len(status.q)} joints; the scenario's has {count}")


def check_alone(end: ControllerEnd) -> None:
    """Refuse a robot that another sender commands.

    Args:
        end: The link.

    Raises:
        InputError: If commands are heard within 0.1 s that were not sent from here.
    """
    end.receive(0.0)  # what came while nobody listened
    end.foreign, until = 0, time.monotonic() + _FOREIGN
    while (left := until - time.monotonic()) > 0.0:
        end.receive(left)
    if end.foreign:
        raise InputError(
            f"{FOREIGN}: {end.foreign} commands on {end.dialect.command_channel} within "
            f"{_FOREIGN:g} s; end the other sender first"
        )


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
