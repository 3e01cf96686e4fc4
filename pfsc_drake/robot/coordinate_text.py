"""Text of joint coordinates for messages."""

from collections.abc import Iterable

import numpy as np

from pfsc_drake.robot.robot_model import RobotModel

_ROUNDING = 1e-12  # rad or m; smaller values are rounding errors


def coordinate_text(value: float, *, revolute: bool) -> str:
    """Return a joint coordinate with its unit, ``0.2 deg`` or ``0.012 m``.

    Args:
        value: The coordinate [rad or m].
        revolute: Whether the joint turns.
    """
    value = without_rounding_error(value)
    if not revolute:
        return f"{value:.4g} m"
    degrees = np.rad2deg(value)
    return f"{degrees:.1f} deg" if abs(degrees) >= 0.1 else f"{degrees:.2g} deg"


def posture_text(robot: RobotModel, q: np.ndarray, joints: Iterable[int] | None = None) -> str:
    """Return joint coordinates by name, ``q_1 = 12.0 deg, q_2 = 0.012 m``.

    Args:
        robot: The robot.
        q: Joint coordinates [rad or m], shape (N,).
        joints: Indices of the joints; by default all.
    """
    chosen, revolute = joints or range(robot.dimension), robot.gather("is_revolute")
    return ", ".join(f"q_{i + 1} = {coordinate_text(q[i], revolute=revolute[i])}" for i in chosen)


def eta_text(eta: Iterable[float], digits: int = 4) -> str:
    """Return tangential coordinates for a message, ``eta = 0.43, 0 m``.

    Args:
        eta: The coordinates [m], shape (k,).
        digits: Number of significant digits.
    """
    values = (f"{without_rounding_error(float(x)):.{digits}g}" for x in eta)
    return f"eta = {', '.join(values)} m"


def without_rounding_error(value: float) -> float:
    """Return a length or an angle [m or rad], 0 if it is a rounding error, below 1e-12."""
    return 0.0 if abs(value) < _ROUNDING else value


def enumeration(words: Iterable[str]) -> str:
    """Return ``a, b and c`` of several words."""
    *most, last = words
    return f"{', '.join(most)} and {last}" if most else last
