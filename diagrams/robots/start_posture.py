"""Start posture of an arm: inverse kinematics from a posture of the scenario, and warnings."""

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.robot.coordinate_text import posture_text
from pfsc_drake.robot.inverse_kinematics import ToolTarget, middle_posture, solve_pose
from pfsc_drake.robot.robot_model import pose_function
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.yaml.fields import spread

# difference from which on the start posture is another one than that of the scenario
_FAR_DEG = 60.0
_FAR_SLIDE = 0.3  # m
# of a tool whose tilt is no task
_LARGEST_TILT_DEG, _SMALL_TILT_DEG = 90.0, 1.0


def start_posture(posture_deg: list[float], chain: SerialChain, target: ToolTarget) -> np.ndarray:
    """Return the start posture, shape (N,) [rad or m].

    Args:
        posture_deg: Initial guess from the scenario; empty for none.
        chain: The robot.
        target: Start pose of the tool.

    Raises:
        InputError: If the pose is out of reach, or the tool's tilt, where it is no task, is far
            from the tilt of the task's orientation.
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
    """Return the tilt of the tool against the target [rad], where it is no task."""
    return target.tilt(np.array(pose_function(chain)(q_J)).ravel()[3:].reshape(3, 3))


def _require_upright(chain: SerialChain, q_J: np.ndarray, target: ToolTarget) -> None:
    tilt = np.rad2deg(_tilt(chain, q_J, target))
    if tilt > _LARGEST_TILT_DEG:
        raise InputError(
            f"start: the tool is tilted by {tilt:.3g} deg against the orientation of the task, and "
            f"task: yaw does not control the tilt; at most {_LARGEST_TILT_DEG:g} deg are allowed: "
            "give the orientation the tool's tilt (a tool that points down: angles_deg "
            "[yaw, 0, 180], convention zyx)"
        )


def tilt_warnings(chain: SerialChain, q_J: np.ndarray, target: ToolTarget) -> list[str]:
    """Return a warning if the tool is tilted against the task's orientation.

    Args:
        chain: The robot.
        q_J: Start posture, shape (N,) [rad or m].
        target: Start pose of the tool.
    """
    if target.yaw_axis is None:
        return []
    tilt = np.rad2deg(_tilt(chain, q_J, target))
    if tilt <= _SMALL_TILT_DEG:
        return []
    return [
        f"the tool is tilted by {tilt:.3g} deg against the orientation of the task; task: yaw "
        "does not control the tilt"
    ]


def posture_warnings(
    posture_deg: list[float], chain: SerialChain, q_J: np.ndarray, target: ToolTarget
) -> list[str]:
    """Return warnings about the start posture of the scenario, one sentence each.

    Args:
        posture_deg: Posture of the scenario; empty for none.
        chain: The robot.
        q_J: The start posture found from it, shape (N,) [rad or m].
        target: Start pose of the tool.
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
    """Return joint coordinates [rad or m] in the units of a scenario, degrees or m."""
    return ", ".join(f"{value:.4g}" for value in np.where(is_angle, np.rad2deg(q), q))


def _fits_in_radians(posture_deg: list[float], chain: SerialChain, target: ToolTarget) -> bool:
    """Return whether the numbers of the posture, read as radians, are close to a solution."""
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
    """Return the initial guess for the start posture, shape (N,) [rad or m].

    Args:
        posture_deg: Posture of the scenario; empty for the middle of the limits.
        chain: The robot.

    Raises:
        InputError: If the number of values differs from the number of joints.
    """
    if not posture_deg:
        return middle_posture(chain)
    posture_deg = spread(posture_deg, chain.dimension)
    if len(posture_deg) != chain.dimension:
        raise InputError(
            f"start.posture_deg = {list(posture_deg)}; allowed: {chain.dimension} values, one per "
            "joint"
        )
    is_angle = np.array([link.is_revolute for link in chain.links])
    return np.where(is_angle, np.deg2rad(posture_deg), posture_deg)
