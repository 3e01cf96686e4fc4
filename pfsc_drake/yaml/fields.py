"""Fields of a schema: types, how a file may write them, what docstrings say, bounds by units.

Every number that a file gives has bounds. What makes sense for one is said by its rules
(:mod:`pfsc_drake.yaml.rules`) and by checks across fields. Where those let a number pass, it must
be within what a person would write in its unit, which the class docstring has in brackets.

How a file may write a field is metadata of the field: ``field(default_factory=list,
metadata=ONE_OR_MANY)``.
"""

import dataclasses
import inspect
import math
import re
import typing
from collections.abc import Iterator
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from pfsc_drake.yaml.rules import Numbers, Range, rules_of

# a key that may not be left out
REQUIRED = {"required": True}
# a list whose only item may be given without list
ONE_OR_MANY = {"one_or_many": True}
# a list of numbers: one without list stands for as many equal ones as are needed
ONE_FOR_ALL = {"one_for_all": True}
# the same of a list for which ``auto`` says that it is empty
AUTO_OR_MANY = {"empty_word": "auto", "one_for_all": True}
# a list of numbers: ``end`` may stand for one of them
NUMBERS_OR_END = {"words": ("end",)}
# text, or a mapping to text, that names a file or a folder; or something known, without a suffix
FILE, NAME_OR_FILE = {"file": True}, {"file": False}

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


def equal(count: int, parts: int = 1) -> dict[str, Any]:
    """Return metadata of a list of a fixed length, for which fewer numbers may stand.

    Args:
        count: Length of the list.
        parts: How many parts it has; one number stands for equal ones in all of the list, so many
            numbers for equal ones in each part.
    """
    return {"equal": count, "parts": parts}


class OneForAll(list[float]):
    """A list of one number that stands for as many equal ones as are needed."""


def spread(values: list[float], count: int) -> list[float]:
    """Return a list, or as many equal numbers as are needed if it is one for all of them.

    Args:
        values: From a field that is declared with ONE_FOR_ALL.
        count: How many are needed.
    """
    return list(values) * count if isinstance(values, OneForAll) else values


class Field(NamedTuple):
    """A field of a schema.

    Attributes:
        name: Its key.
        kind: Its type, without rules.
        hint: Its type with its rules.
        form: How a file may write it, metadata as above.
        default: What makes its default; None of one that has none.
        bounds: What its numbers may be in a file beside its rules, by their unit; None of a field
            that no docstring describes.
    """

    name: str
    kind: Any
    hint: Any
    form: typing.Mapping[str, Any]
    default: typing.Callable[[], Any] | None
    bounds: Range | None

    @property
    def required(self) -> bool:
        """Whether its key may not be left out."""
        return self.default is None or bool(self.form.get("required"))

    @property
    def takes_a_number(self) -> bool:
        """Whether a number may stand for its list."""
        return any(key in self.form for key in ("one_or_many", "one_for_all", "equal"))

    def out_of_bounds(self, value: Any) -> Iterator[tuple[str, float]]:
        """Yield the numbers of a value that are beyond its bounds, and their places."""
        if self.bounds is not None and value is not None:
            default = self.default and self.default()
            for place, number in _numbers(value, self.name):
                usual = isinstance(default, float) and number == default
                if not (usual or self.bounds.allows(number)):
                    yield place, number


@cache
def fields_of(owner: type) -> dict[str, Field]:
    """Return the fields of a dataclass by name."""
    kinds = typing.get_type_hints(owner)
    hints = typing.get_type_hints(owner, include_extras=True)
    return {
        field.name: Field(
            field.name,
            kinds[field.name],
            hints[field.name],
            field.metadata,
            _maker(field),
            _bounds(owner, field, hints[field.name]),
        )
        for field in dataclasses.fields(owner)
    }


def attribute_text(owner: type, name: str) -> str | None:
    """Return what the docstring of a class, or of one it inherits from, says of an attribute."""
    entry = re.compile(rf"^    {name}: (.*(?:\n        .*)*)", re.MULTILINE)
    for base in owner.__mro__:
        found = entry.search(inspect.cleandoc(base.__dict__.get("__doc__") or ""))
        if found:
            return " ".join(found[1].split())
    return None


def _maker(field: "dataclasses.Field[Any]") -> typing.Callable[[], Any] | None:
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory
    value = field.default
    return None if value is dataclasses.MISSING else lambda: value


def _bounds(owner: type, field: "dataclasses.Field[Any]", hint: Any) -> Range | None:
    """Return the bounds of a field by the unit that its docstring has, or else its rules."""
    text, rules = attribute_text(owner, field.name), list(ranges_of(hint))
    if text is None:
        return None
    # what is literal are lists
    brackets = _BRACKETS.findall(_LITERAL.sub("", text)) + [rule.unit for rule in rules]
    known = (unit for unit in brackets if _largest(unit) is not None)
    unit = next(known, "deg" if field.name.endswith("_deg") else "")
    largest = _largest(unit) or _OTHERS
    least = -math.inf if field.default == -math.inf else -largest
    no_limit = field.default == math.inf or any(rule.infinite for rule in rules)
    no_limit = no_limit or bool(re.search(r"\binf(inite)?\b", text))
    return Range(least, largest, unit, infinite=no_limit)


def ranges_of(hint: Any) -> Iterator[Range]:
    """Yield the ranges that the rules of a type, or of those within, allow its numbers."""
    for rule in rules_of(hint):
        if isinstance(rule, (Range, Numbers)):
            yield rule.each if isinstance(rule, Numbers) else rule
    for argument in typing.get_args(hint):
        yield from ranges_of(argument)


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
