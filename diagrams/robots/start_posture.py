"""The posture in which an arm starts: given, looked for from there, and what is odd about it."""

import numpy as np

from diagrams.wording import posture_text
from pfsc_drake.errors import InputError
from pfsc_drake.robot.inverse_kinematics import UNLIMITED, ToolTarget, solve_pose
from pfsc_drake.robot.serial.chain import SerialChain

# from where on a posture that was found is another one than the posture given
_FAR_DEG = 60.0
_FAR_SLIDE = 0.3  # m


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
        lower, upper = np.clip(chain.gather("position_limits"), -UNLIMITED, UNLIMITED).T
        limited = np.maximum(-lower, upper) < UNLIMITED
        return np.where(limited, (lower + upper) / 2.0, np.clip(0.0, lower, upper))
    if len(posture_deg) != chain.dimension:
        raise InputError(
            f"start.posture_deg: {len(posture_deg)} values; the robot has {chain.dimension} joints"
        )
    is_angle = np.array([link.is_revolute for link in chain.links])
    return np.where(is_angle, np.deg2rad(posture_deg), posture_deg)
