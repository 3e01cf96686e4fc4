"""Checks of scenario values."""

from collections.abc import Sequence

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.errors import require as require
from pfsc_drake.errors import require_positive as require_positive
from pfsc_drake.geometry.size import FARTHEST, SHORTEST

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
