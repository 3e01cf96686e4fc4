"""Joint coordinates as a person reads them."""

from collections.abc import Iterable

import numpy as np

from pfsc_drake.robot.robot_model import RobotModel


def coordinate_text(value: float, *, revolute: bool) -> str:
    """Return a joint coordinate with its unit, ``0.2 deg`` or ``0.012 m``.

    Args:
        value: The coordinate [rad or m].
        revolute: Whether the joint turns.
    """
    if not revolute:
        return f"{value:.4g} m"
    degrees = np.rad2deg(value)
    return f"{degrees:.1f} deg" if abs(degrees) >= 0.1 else f"{degrees:.2g} deg"


def posture_text(robot: RobotModel, q: np.ndarray, joints: Iterable[int] | None = None) -> str:
    """Return joint coordinates by name, ``q_1 = 12.0 deg, q_2 = 0.012 m``.

    Args:
        robot: The robot.
        q: Joint coordinates [rad or m], shape (N,).
        joints: Indices of the joints to tell; by default all.
    """
    chosen, revolute = joints or range(robot.dimension), robot.gather("is_revolute")
    return ", ".join(f"q_{i + 1} = {coordinate_text(q[i], revolute=revolute[i])}" for i in chosen)


def listed(words: Iterable[str]) -> str:
    """Return ``a, b and c`` of several words."""
    *most, last = words
    return f"{', '.join(most)} and {last}" if most else last
