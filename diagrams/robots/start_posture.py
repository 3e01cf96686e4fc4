"""The posture in which an arm starts: given, looked for from there, and what is odd about it."""

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.robot.coordinate_text import posture_text
from pfsc_drake.robot.inverse_kinematics import ToolTarget, middle_posture, solve_pose
from pfsc_drake.robot.robot_model import pose_function
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.yaml.fields import spread

# from where on a posture that was found is another one than the posture given
_FAR_DEG = 60.0
_FAR_SLIDE = 0.3  # m
# of a tool against its orientation, where it is no task
_LARGEST_TILT_DEG, _SMALL_TILT_DEG = 90.0, 1.0


def start_posture(posture_deg: list[float], chain: SerialChain, target: ToolTarget) -> np.ndarray:
    """Return the posture in which the tool starts, shape (N,) [rad or m].

    Args:
        posture_deg: From where it is looked for, as the scenario gives it; empty for none.
        chain: The robot.
        target: Where the tool starts.

    Raises:
        InputError: If it is out of reach, or the tool's tilt, where it is no task, is far from
            what the task's orientation asks.
    """
    near = posture_near(posture_deg, chain)
    if target.yaw_axis is None:
        return solve_pose(chain, target, near, "start")
    try:
        q_J = solve_pose(chain, target, near, "start")
    except InputError:
        _require_upright(chain, near, target)
        raise
    _require_upright(chain, q_J, target)
    return q_J


def _tilt(chain: SerialChain, q_J: np.ndarray, target: ToolTarget) -> float:
    """Return by how much the tool is tilted against the target [rad], where that is no task."""
    return target.tilt(np.array(pose_function(chain)(q_J)).ravel()[3:].reshape(3, 3))


def _require_upright(chain: SerialChain, q_J: np.ndarray, target: ToolTarget) -> None:
    tilt = np.rad2deg(_tilt(chain, q_J, target))
    if tilt > _LARGEST_TILT_DEG:
        raise InputError(
            f"start: the tool is tilted by {tilt:.3g} deg against the orientation of the task, and "
            f"task: yaw leaves the tilt as it is; at most {_LARGEST_TILT_DEG:g} deg are allowed: "
            "give the orientation the tool's tilt (a tool that points down: angles_deg "
            "[yaw, 0, 180], convention zyx)"
        )


def tilt_warnings(chain: SerialChain, q_J: np.ndarray, target: ToolTarget) -> list[str]:
    """Return what is said of a tilt that the task asks and the tool does not have.

    Args:
        chain: The robot.
        q_J: Start posture, shape (N,) [rad or m].
        target: Where the tool starts.
    """
    if target.yaw_axis is None:
        return []
    tilt = np.rad2deg(_tilt(chain, q_J, target))
    if tilt <= _SMALL_TILT_DEG:
        return []
    return [
        f"the tool is tilted by {tilt:.3g} deg against the orientation of the task; task: yaw "
        "leaves the tilt as it is"
    ]


def posture_warnings(
    posture_deg: list[float], chain: SerialChain, q_J: np.ndarray, target: ToolTarget
) -> list[str]:
    """Return what is odd about a given start posture, one sentence each.

    Args:
        posture_deg: As the scenario gives it; empty for none.
        chain: The robot.
        q_J: The start posture found from there, shape (N,) [rad or m].
        target: Where the tool starts.
    """
    if not posture_deg:
        return []
    posture_deg = spread(posture_deg, chain.dimension)
    is_angle = np.array([link.is_revolute for link in chain.links])
    unit = np.where(is_angle, np.deg2rad(_FAR_DEG), _FAR_SLIDE)
    distance = np.abs(q_J - posture_near(posture_deg, chain)) / unit
    if distance.max() <= 1.0:
        return []
    found = posture_text(chain, q_J)
    if _fits_in_radians(posture_deg, chain, target):
        return [
            f"start.posture_deg: {posture_deg} looks like radians; the robot starts at {found}: "
            f"write [{_written(is_angle, np.array(posture_deg))}]"
        ]
    worst = chain.names[int(distance.argmax())]
    return [
        f"start.posture_deg: {posture_deg} is far from any solution, {worst} most; the robot "
        f"starts at {found}, perhaps in another configuration than meant; if it is the one, "
        f"write [{_written(is_angle, q_J)}]"
    ]


def _written(is_angle: np.ndarray, q: np.ndarray) -> str:
    """Return joint coordinates [rad or m] as they stand in a scenario, in degrees or m."""
    return ", ".join(f"{value:.4g}" for value in np.where(is_angle, np.rad2deg(q), q))


def _fits_in_radians(posture_deg: list[float], chain: SerialChain, target: ToolTarget) -> bool:
    """Return whether the same digits, as radians, are next to a solution of their own."""
    angles = np.array([link.is_revolute for link in chain.links])
    as_radians = np.array(posture_deg)
    turns = np.abs(as_radians[angles]).max(initial=0.0)
    if not 0.0 < turns <= 2.0 * np.pi:
        return False
    try:
        solution = solve_pose(chain, target, as_radians, "start")
    except InputError:
        return False
    return bool(np.all(np.abs(solution - as_radians)[angles] < np.deg2rad(_FAR_DEG)))


def posture_near(posture_deg: list[float], chain: SerialChain) -> np.ndarray:
    """Return the posture from which the start is looked for, shape (N,) [rad or m].

    Args:
        posture_deg: As the scenario gives it; empty for the middle of the limits.
        chain: The robot.

    Raises:
        InputError: If there are more or fewer joints.
    """
    if not posture_deg:
        return middle_posture(chain)
    posture_deg = spread(posture_deg, chain.dimension)
    if len(posture_deg) != chain.dimension:
        raise InputError(
            f"start.posture_deg: {len(posture_deg)} values; the robot has {chain.dimension} joints"
        )
    is_angle = np.array([link.is_revolute for link in chain.links])
    return np.where(is_angle, np.deg2rad(posture_deg), posture_deg)
