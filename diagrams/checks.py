"""Checks of scenario values."""

from collections.abc import Sequence

import numpy as np

from pfsc_drake.errors import InputError


def require(condition: bool, key: str, value: object, allowed: str) -> None:
    """Refuse a value.

    Args:
        condition: Whether the value is allowed.
        key: Its key.
        value: The value.
        allowed: What is allowed, for people.

    Raises:
        InputError: If it is not.
    """
    if not condition:
        raise InputError(f"{key} = {value}; allowed: {allowed}")


def require_positive(key: str, value: float) -> None:
    """Refuse a value that is not a positive finite number."""
    require(bool(np.isfinite(value)) and value > 0.0, key, value, "a positive number")


def require_not_negative(key: str, value: float) -> None:
    """Refuse a value that is negative or not finite."""
    require(bool(np.isfinite(value)) and value >= 0.0, key, value, "zero or a positive number")


def require_numbers(key: str, values: Sequence[float], count: int) -> None:
    """Refuse a list of another length, or with values that are not finite."""
    valid = len(values) == count and bool(np.isfinite(values).all())
    require(valid, key, list(values), f"{count} finite numbers")
