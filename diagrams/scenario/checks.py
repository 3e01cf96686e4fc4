"""Checks of scenario values, and joint coordinates as a person reads them."""

from collections.abc import Iterable, Sequence

import numpy as np

from pfsc_drake.checks import LARGEST_ANGLE as LARGEST_ANGLE
from pfsc_drake.checks import require as require
from pfsc_drake.checks import require_between as require_between
from pfsc_drake.checks import require_not_negative as require_not_negative
from pfsc_drake.checks import require_numbers as require_numbers
from pfsc_drake.checks import require_one_of as require_one_of
from pfsc_drake.checks import require_positive as require_positive
from pfsc_drake.checks import require_whole_fraction as require_whole_fraction
from pfsc_drake.checks import require_whole_ticks as require_whole_ticks
from pfsc_drake.geometry.curves.curve import FARTHEST, SHORTEST
from pfsc_drake.robot.robot_model import RobotModel


def require_length(key: str, value: float) -> None:
    """Refuse what is no length of anything that a robot meets [m]."""
    require(SHORTEST <= value <= FARTHEST, key, value, f"{SHORTEST:g} m to {FARTHEST:g} m")


def require_place(key: str, values: Sequence[float]) -> None:
    """Refuse what is no point [m] within reach of numbers."""
    require_numbers(key, values, 3)
    near = max(map(abs, values)) <= FARTHEST
    require(near, key, values, f"3 numbers of at most {FARTHEST:g} m")


def require_direction(key: str, values: Sequence[float]) -> None:
    """Refuse what is no direction, of whatever length."""
    require_numbers(key, values, 3)
    require(any(values), key, values, "3 numbers, not all zero")


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
