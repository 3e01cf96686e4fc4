"""The one error raised for input that cannot be used."""

import math

MAX_MESSAGE = 1000  # characters


class InputError(ValueError):
    """Input from outside is wrong; raised where it enters, before anything moves.

    The message is one line that names the thing (file, key, parameter), its
    value and what is allowed. One of more than MAX_MESSAGE characters is
    shortened in its middle, where the value stands.
    """

    def __init__(self, message: str) -> None:
        super().__init__(shortened(message, MAX_MESSAGE))


class WriteError(InputError):
    """What was asked for is done, but could not be written: a full disk, or a broken one."""


def shortened(text: str, length: int = 60) -> str:
    """Returns a text, without its middle if it is longer than ``length`` characters."""
    if len(text) <= length:
        return text
    tail = (length - 3) // 3
    return f"{text[: length - 3 - tail]}...{text[len(text) - tail :]}"


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
    require(0.0 < value < math.inf, key, value, "a positive number")
