"""Checks of values from users."""

import math
import re
from collections.abc import Sequence

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.errors import require as require
from pfsc_drake.errors import require_one_of as require_one_of
from pfsc_drake.errors import require_positive as require_positive

LARGEST_ANGLE = 3600.0  # deg; ten turns
# m; shorter lengths are no motion of a robot, and larger coordinates leave no digits for it
SHORTEST, FARTHEST = 1e-4, 1e4
# Text that is a number. Python's float() accepts more: underscores, the digits of all scripts.
NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
_INFINITY = re.compile(r"[-+]?inf(inity)?", re.IGNORECASE)
_ROUNDING = 1e-6


def is_number(value: float | str) -> bool:
    """Whether a number, or text that is one, fits a float; infinity does, NaN does not.

    YAML 1.1 reads 1e-3 as text.
    """
    if isinstance(value, str) and not NUMBER.fullmatch(value):
        return bool(_INFINITY.fullmatch(value))
    try:
        number = float(value)
    except OverflowError:
        return False
    # text beyond the largest float would be read as infinite
    return not math.isnan(number) and not (isinstance(value, str) and math.isinf(number))


def require_not_negative(key: str, value: float) -> None:
    """Refuse a value that is negative or not finite."""
    require(bool(np.isfinite(value)) and value >= 0.0, key, value, "zero or a positive number")


def require_between(key: str, value: float, least: float, most: float, unit: str) -> None:
    """Refuse a value outside a range; both ends are allowed."""
    require(least <= value <= most, key, value, f"{least:g} to {most:g} {unit}")


def require_numbers(key: str, values: Sequence[float] | np.ndarray, count: int) -> None:
    """Refuse a list or an array of another length, or with values that are not finite."""
    valid = np.shape(values) == (count,) and bool(np.isfinite(values).all())
    require(valid, key, values, f"{count} finite numbers")


def require_length(key: str, value: float) -> None:
    """Refuse a length outside the range for robots [m]."""
    require(SHORTEST <= value <= FARTHEST, key, value, f"{SHORTEST:g} m to {FARTHEST:g} m")


def require_point(key: str, values: Sequence[float]) -> None:
    """Refuse a point outside the range for robots [m]."""
    require_numbers(key, values, 3)
    valid = max(map(abs, values)) <= FARTHEST
    require(valid, key, values, f"3 numbers of at most {FARTHEST:g} m")


def require_direction(key: str, values: Sequence[float]) -> None:
    """Refuse a direction of zero length; any other length is allowed."""
    require_numbers(key, values, 3)
    require(any(values), key, values, "3 numbers, not all zero")


def require_whole_fraction(key: str, step: float, sampling_time: float) -> int:
    """Refuse a step that is not a whole fraction of the controller's sampling time.

    Args:
        key: Key of the step.
        step: The step [s].
        sampling_time: Sampling time of the controller [s].

    Returns:
        Number of steps in a sampling time.

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


def require_whole_ticks(key: str, delay: float, sampling_time: float, most: int) -> int:
    """Refuse a delay that is not a multiple of the controller's sampling time.

    Args:
        key: Key of the delay.
        delay: The delay [s].
        sampling_time: Sampling time of the controller [s].
        most: Largest number of ticks.

    Returns:
        The delay in ticks.

    Raises:
        InputError: If it is not a multiple, or too long.
    """
    ticks = round(delay / sampling_time)
    whole = abs(ticks * sampling_time - delay) < _ROUNDING * sampling_time
    allowed = f"a multiple of the sampling time {sampling_time:g} s, at most {most:,} of it"
    require(whole and 0 <= ticks <= most, key, delay, allowed)
    return ticks


def checked_vector(
    subject: str, name: str, value: np.ndarray, size: int, *, positive: bool
) -> np.ndarray:
    """Return a read-only copy with one finite number per joint.

    Args:
        subject: Owner of the parameter, for the message.
        name: Name of the parameter.
        value: The parameter.
        size: Required length.
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
