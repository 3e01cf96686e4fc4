"""Checks of values that people write."""

from collections.abc import Sequence

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.errors import require as require
from pfsc_drake.errors import require_positive as require_positive

LARGEST_ANGLE = 3600.0  # deg; ten turns
_ROUNDING = 1e-6


def require_not_negative(key: str, value: float) -> None:
    """Refuse a value that is negative or not finite."""
    require(bool(np.isfinite(value)) and value >= 0.0, key, value, "zero or a positive number")


def require_between(key: str, value: float, least: float, most: float, unit: str) -> None:
    """Refuse a value outside a range, both ends being allowed."""
    require(least <= value <= most, key, value, f"{least:g} to {most:g} {unit}")


def require_numbers(key: str, values: Sequence[float], count: int) -> None:
    """Refuse a list of another length, or with values that are not finite."""
    valid = len(values) == count and bool(np.isfinite(values).all())
    require(valid, key, list(values), f"{count} finite numbers")


def require_whole_fraction(key: str, step: float, sampling_time: float) -> int:
    """Refuse a step that does not fit into the controller's sampling time a whole number of times.

    Args:
        key: Key of the step.
        step: The step [s].
        sampling_time: Of the controller [s].

    Returns:
        How many times it fits.

    Raises:
        InputError: If it does not fit.
    """
    ratio = sampling_time / step
    if round(ratio) < 1 or abs(ratio - round(ratio)) > _ROUNDING:
        raise InputError(
            f"{key} = {step:g} s; must be a whole fraction of "
            f"controller.sampling_time = {sampling_time:g} s"
        )
    return round(ratio)
