"""Units of length in files."""

from typing import Literal

from pfsc_drake.errors import InputError

Unit = Literal["m", "cm", "mm", "inch"]

_METRES: dict[str, float] = {"m": 1.0, "cm": 0.01, "mm": 0.001, "inch": 0.0254}
UNITS = tuple(_METRES)


def metres(unit: str) -> float:
    """Return how many metres a unit is.

    Args:
        unit: One of `UNITS`.

    Raises:
        InputError: If it is none.
    """
    if unit not in _METRES:
        raise InputError(f"unit: '{unit}'; one of {', '.join(UNITS)} is required")
    return _METRES[unit]
