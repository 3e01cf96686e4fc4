"""Checks of physical parameters, with messages that name key, value and what is allowed."""

import numpy as np

from pfsc_drake.errors import InputError


def require(condition: bool, key: str, value: object, allowed: str) -> None:
    """Refuse a parameter unless a condition holds.

    Args:
        condition: Whether the value is fine.
        key: Key of the parameter, as in its file.
        value: Value of the parameter, for the message.
        allowed: What it must be, for the message.

    Raises:
        InputError: If the condition does not hold.
    """
    if not condition:
        shown = value.tolist() if isinstance(value, np.ndarray) else value
        raise InputError(f"{key} = {shown!r}: must be {allowed}")


def check_vector(key: str, value: np.ndarray, size: int) -> None:
    """Refuse a vector of another size or with numbers that are not finite.

    Args:
        key: Key of the parameter, as in its file.
        value: The vector.
        size: How many numbers it must have.

    Raises:
        InputError: If it is refused.
    """
    fits = value.shape == (size,) and bool(np.all(np.isfinite(value)))
    require(fits, key, value, f"{size} finite numbers")
