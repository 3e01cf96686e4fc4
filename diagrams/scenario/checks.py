"""Checks of scenario values, and types with rules that several blocks have."""

from collections.abc import Sequence
from typing import Annotated

from pfsc_drake.checks import LARGEST_ANGLE as LARGEST_ANGLE
from pfsc_drake.checks import require as require
from pfsc_drake.checks import require_between as require_between
from pfsc_drake.checks import require_not_negative as require_not_negative
from pfsc_drake.checks import require_numbers as require_numbers
from pfsc_drake.checks import require_one_of as require_one_of
from pfsc_drake.checks import require_positive as require_positive
from pfsc_drake.checks import require_whole_fraction as require_whole_fraction
from pfsc_drake.checks import require_whole_ticks as require_whole_ticks
from pfsc_drake.geometry.curves.curve import FARTHEST, SHORTEST
from pfsc_drake.yaml.rules import Numbers, Range

Length = Annotated[float, Range(SHORTEST, FARTHEST, "m")]
Point = Annotated[list[float], Numbers(3, Range(-FARTHEST, FARTHEST, "m"))]
Direction = Annotated[list[float], Numbers(3, some=True)]
Pair = Annotated[list[float], Numbers(2)]


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
