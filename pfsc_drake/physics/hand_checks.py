"""Checks of properties of hands."""

from pfsc_drake.errors import InputError


def require(condition: bool, key: str, value: object, must_be: str) -> None:
    """Refuse a value.

    Args:
        condition: Whether the value is allowed.
        key: Its key.
        value: The value.
        must_be: What it must be, for people.

    Raises:
        InputError: If it is not.
    """
    if not condition:
        raise InputError(f"{key} = {value}: must be {must_be}")
