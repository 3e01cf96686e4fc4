"""Checks of parameters that laws of several kinds share."""

import numpy as np

from pfsc_drake.errors import InputError


def checked_vector(
    subject: str, name: str, value: np.ndarray, size: int, *, positive: bool
) -> np.ndarray:
    """Return a copy that cannot be written, one finite number per joint.

    Args:
        subject: What the parameter belongs to, for the message.
        name: Name of the parameter.
        value: The parameter.
        size: How many numbers it needs.
        positive: Whether zero is refused too.

    Raises:
        InputError: If the number of values is wrong, or one is negative or not finite.
    """
    array = np.array(value, dtype=float)
    if array.shape != (size,) or size == 0:
        raise InputError(f"{subject}: {name} of shape {array.shape}; must be ({size},)")
    low = array <= 0.0 if positive else array < 0.0
    if np.any(low | ~np.isfinite(array)):
        allowed = "positive and finite" if positive else "finite and not negative"
        raise InputError(f"{subject}: {name} = {array.tolist()}; must be {allowed}")
    array.flags.writeable = False
    return array
