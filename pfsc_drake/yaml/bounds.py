"""Bounds of the numbers in a schema, by their units or as their fields say.

Every number that a file gives has bounds. What makes sense for one is said by its dataclass, in
``__post_init__``. Where that lets a number pass, it must be within what a person would write in its
unit, which the class docstring has in brackets; a field of its own range has it as metadata::

    margin: float = field(default=0.1, metadata=bounded(0.0, 5.0, "m"))
"""

import dataclasses
import inspect
import math
import re
from collections.abc import Iterator
from functools import cache
from typing import Any, NamedTuple

import numpy as np

# largest magnitudes by unit; of several, such as "rad or m", the largest of them counts
_LARGEST = {
    "m": 1e4, "s": 1e6, "kg": 1e5, "N": 1e6, "Nm": 1e6, "J": 1e6, "Hz": 1e6, "rad": 1e4, "deg": 1e5,
    "m/s": 1e3, "rad/s": 1e5, "deg/s": 1e6, "m/s^2": 1e5, "rad/s^2": 1e6, "deg/s^2": 1e7,
    "m/s^3": 1e7, "1/s": 1e6, "1/m": 1e6, "s/m": 1e4, "N/m": 1e10, "Nm/rad": 1e9, "N s/m": 1e8,
    "Nm s/rad": 1e7, "kg m^2": 1e5, "Nm/s": 1e9, "Pa": 1e13,
}  # fmt: skip
# of shares, factors, directions and counts, and of units that are rare
_OTHERS = 1e9
_BRACKETS = re.compile(r"\[([^\[\]]*)\]")
_LITERAL = re.compile(r"``[^`]*``")
_SEVERAL = re.compile(r", | or ")
_KEY = "bounds"


class Bounds(NamedTuple):
    """What a number may be.

    Attributes:
        least: Smallest value.
        most: Largest value.
        unit: Unit, empty for none.
        infinite: Whether infinity stands for no limit.
    """

    least: float
    most: float
    unit: str = ""
    infinite: bool = False

    def allow(self, value: float) -> bool:
        """Return whether a number is within the bounds."""
        return self.least <= value <= self.most or (self.infinite and value == math.inf)

    def __str__(self) -> str:
        """Return the bounds in words."""
        unit = f" {self.unit}" if self.unit else ""
        more = ", or .inf" if self.infinite else ""
        return f"a number from {self.least:g} to {self.most:g}{unit}{more}"


def bounded(least: float, most: float, unit: str = "", *, infinite: bool = False) -> dict[str, Any]:
    """Return metadata of a field whose numbers have bounds of their own.

    Args:
        least: Smallest value.
        most: Largest value.
        unit: Unit, empty for none.
        infinite: Whether infinity is allowed, too.
    """
    return {_KEY: Bounds(least, most, unit, infinite)}


@cache
def bounds_of(owner: type, name: str) -> Bounds:
    """Return the bounds of a field of a dataclass; none of one that no docstring describes.

    Args:
        owner: The dataclass.
        name: Name of the field.
    """
    field = next(field for field in dataclasses.fields(owner) if field.name == name)
    if _KEY in field.metadata:
        return Bounds(*field.metadata[_KEY])
    text = attribute_text(owner, name)
    if text is None:
        return Bounds(-math.inf, math.inf)
    # what is literal are lists
    brackets = _BRACKETS.findall(_LITERAL.sub("", text))
    known = (unit for unit in brackets if _largest(unit) is not None)
    unit = next(known, "deg" if name.endswith("_deg") else "")
    largest = _largest(unit) or _OTHERS
    least = -math.inf if field.default == -math.inf else -largest
    no_limit = field.default == math.inf or bool(re.search(r"\binf(inite)?\b", text))
    return Bounds(least, largest, unit, no_limit)


def attribute_text(owner: type, name: str) -> str | None:
    """Return what the docstring of a class, or of one it inherits from, says of an attribute."""
    entry = re.compile(rf"^    {name}: (.*(?:\n        .*)*)", re.MULTILINE)
    for base in owner.__mro__:
        found = entry.search(inspect.cleandoc(base.__dict__.get("__doc__") or ""))
        if found:
            return " ".join(found[1].split())
    return None


def out_of_bounds(value: Any) -> Iterator[tuple[str, float, Bounds]]:
    """Yield place, value and bounds of the numbers of a dataclass that are beyond them.

    Args:
        value: Instance of a dataclass; other dataclasses in it are not looked into.
    """
    owner: Any = type(value)
    for field in dataclasses.fields(value):
        for place, number in _numbers(getattr(value, field.name), field.name):
            bounds = bounds_of(owner, field.name)
            if not bounds.allow(number):
                yield place, number, bounds


def _numbers(value: Any, place: str) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a value, in lists and mappings, too, with their places."""
    if isinstance(value, (float, int, np.number)) and not isinstance(value, bool):
        yield place, float(value)
    elif isinstance(value, (list, np.ndarray)):
        for index, item in enumerate(value):
            yield from _numbers(item, f"{place}[{index}]")
    elif isinstance(value, dict):
        for name, item in value.items():
            yield from _numbers(item, f"{place}.{name}")


def _largest(unit: str) -> float | None:
    """Return the largest magnitude in a unit, or in one of several; None of what is no unit."""
    found = [_LARGEST.get(part) for part in _SEVERAL.split(unit)]
    known = [size for size in found if size is not None]
    return max(known) if len(known) == len(found) else None
