"""Fields of a schema: types, accepted spellings in a file, descriptions, bounds by units.

Every number in a file has bounds. The rules of its field (:mod:`pfsc_drake.yaml.rules`) and checks
across fields decide which numbers make sense. A number that they accept must also be plausible in
its unit, which the class docstring has in brackets.

The accepted spellings are metadata of the field: ``field(default_factory=list,
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

# a mandatory key
REQUIRED = {"required": True}
# a list whose only item may be written without list
ONE_OR_MANY = {"one_or_many": True}
# a list of numbers: a single number stands for as many equal ones as are needed
ONE_FOR_ALL = {"one_for_all": True}
# the same for a list that ``auto`` leaves empty
AUTO_OR_MANY = {"empty_word": "auto", "one_for_all": True}
# a list of numbers: ``end`` may stand for one of them
NUMBERS_OR_END = {"words": ("end",)}
# text, or a mapping to text, with the name of a file or a folder; or a known name without suffix
FILE, NAME_OR_FILE = {"file": True}, {"file": False}

# largest magnitudes by unit; of several, such as "rad or m", the largest one applies
_LARGEST = {
    "m": 1e4, "s": 1e6, "kg": 1e5, "N": 1e6, "Nm": 1e6, "J": 1e6, "Hz": 1e6, "rad": 1e4, "deg": 1e5,
    "m/s": 1e3, "rad/s": 1e5, "deg/s": 1e6, "m/s^2": 1e5, "rad/s^2": 1e6, "deg/s^2": 1e7,
    "m/s^3": 1e7, "1/s": 1e6, "1/m": 1e6, "s/m": 1e4, "N/m": 1e10, "Nm/rad": 1e9, "N s/m": 1e8,
    "Nm s/rad": 1e7, "kg m^2": 1e5, "Nm/s": 1e9, "Pa": 1e13,
}  # fmt: skip
# for shares, factors, directions, counts and rare units
_OTHERS = 1e9
_BRACKETS = re.compile(r"\[([^\[\]]*)\]")
_LITERAL = re.compile(r"``[^`]*``")
_SEVERAL = re.compile(r", | or ")


def equal(count: int, parts: int = 1) -> dict[str, Any]:
    """Return metadata of a list of a fixed length that may be written with fewer numbers.

    Args:
        count: Length of the list.
        parts: Number of parts; one number stands for equal ones in the whole list, one number a
            part for equal ones within each part.
    """
    return {"equal": count, "parts": parts}


def former(name: str) -> dict[str, str]:
    """Return metadata of a renamed key, whose former name is still read, with a warning.

    Args:
        name: Former name.
    """
    return {"former": name}


class OneForAll(list[float]):
    """A list of one number that stands for as many equal ones as are needed."""


def spread(values: list[float], count: int) -> list[float]:
    """Return a list, repeated to the required length if it is one number for all.

    Args:
        values: From a field declared with ONE_FOR_ALL.
        count: Required length.
    """
    return list(values) * count if isinstance(values, OneForAll) else values


class Field(NamedTuple):
    """A field of a schema.

    Attributes:
        name: Key.
        kind: Type without rules.
        hint: Type with its rules.
        form: Accepted spellings in a file, metadata as above.
        default: Factory of its default; None if it has none.
        bounds: Bounds of its numbers in a file beside its rules, by their unit; None for a field
            without a description.
    """

    name: str
    kind: Any
    hint: Any
    form: typing.Mapping[str, Any]
    default: typing.Callable[[], Any] | None
    bounds: Range | None

    @property
    def required(self) -> bool:
        """Whether its key is mandatory."""
        return self.default is None or bool(self.form.get("required"))

    @property
    def takes_a_number(self) -> bool:
        """Whether a number may stand for its list."""
        return any(key in self.form for key in ("one_or_many", "one_for_all", "equal"))

    def out_of_bounds(self, value: Any) -> Iterator[tuple[str, float]]:
        """Yield the numbers of a value that are out of bounds, with their keys."""
        if self.bounds is not None and value is not None:
            default = self.default and self.default()
            for key, number in _numbers(value, self.name):
                usual = isinstance(default, float) and number == default
                if not (usual or self.bounds.allows(number)):
                    yield key, number


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
            _default_factory(field),
            _bounds(owner, field, hints[field.name]),
        )
        for field in dataclasses.fields(owner)
    }


@cache
def former_names(owner: type) -> dict[str, str]:
    """Return the present names of the renamed keys of a dataclass, by their former names."""
    fields = fields_of(owner).values()
    return {field.form["former"]: field.name for field in fields if "former" in field.form}


def attribute_text(owner: type, name: str) -> str | None:
    """Return the description of an attribute in the docstring of a class or of its bases."""
    entry = re.compile(rf"^    {name}: (.*(?:\n        .*)*)", re.MULTILINE)
    for base in owner.__mro__:
        found = entry.search(inspect.cleandoc(base.__dict__.get("__doc__") or ""))
        if found:
            return " ".join(found[1].split())
    return None


def _default_factory(field: "dataclasses.Field[Any]") -> typing.Callable[[], Any] | None:
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory
    value = field.default
    return None if value is dataclasses.MISSING else lambda: value


def _bounds(owner: type, field: "dataclasses.Field[Any]", hint: Any) -> Range | None:
    """Return a field's bounds by the unit in its docstring, or else by its rules."""
    text, rules = attribute_text(owner, field.name), list(ranges_of(hint))
    if text is None:
        return None
    # literals contain lists, not units
    brackets = _BRACKETS.findall(_LITERAL.sub("", text)) + [rule.unit for rule in rules]
    known = (unit for unit in brackets if _largest(unit) is not None)
    unit = next(known, "deg" if field.name.endswith("_deg") else "")
    largest = _largest(unit) or _OTHERS
    least = -math.inf if field.default == -math.inf else -largest
    no_limit = field.default == math.inf or any(rule.infinite for rule in rules)
    no_limit = no_limit or bool(re.search(r"\binf(inite)?\b", text))
    return Range(least, largest, unit, infinite=no_limit)


def ranges_of(hint: Any) -> Iterator[Range]:
    """Yield the ranges for the numbers of a type, from its rules and those of inner types."""
    for rule in rules_of(hint):
        if isinstance(rule, (Range, Numbers)):
            yield rule.each if isinstance(rule, Numbers) else rule
    for argument in typing.get_args(hint):
        yield from ranges_of(argument)


def _numbers(value: Any, key: str) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a value, also in lists and mappings, with their keys."""
    if isinstance(value, (float, int, np.number)) and not isinstance(value, bool):
        yield key, float(value)
    elif isinstance(value, (list, np.ndarray)):
        for index, item in enumerate(value):
            yield from _numbers(item, f"{key}[{index}]")
    elif isinstance(value, dict):
        for name, item in value.items():
            yield from _numbers(item, f"{key}.{name}")


def _largest(unit: str) -> float | None:
    """Return the largest magnitude in a unit, or in one of several; None for an unknown unit."""
    found = [_LARGEST.get(part) for part in _SEVERAL.split(unit)]
    known = [size for size in found if size is not None]
    return max(known) if len(known) == len(found) else None
