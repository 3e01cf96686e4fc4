"""Rules of values, declared on the fields of parameter dataclasses.

A rule is metadata of an annotated type, declared once for all its uses: it is checked when an
object is created, in Python or from a file (:mod:`pfsc_drake.yaml.typed`), and appears in the
reference of keys and in the JSON schema for editors (:mod:`pfsc_drake.yaml.json_schema`)::

    @dataclass
    class Tank(Parameters):
        capacity: Positive = 4.0
        initial: Annotated[float, Range(0.0, 10.0, "J")] = 0.2
        kind: Annotated[str, OneOf(KINDS)] = "soft"

        def __post_init__(self) -> None:
            super().__post_init__()  # rules of single fields, then checks across fields
            require(self.initial <= self.capacity, "initial", self.initial, "capacity or less")
"""

import dataclasses
import math
import types
import typing
from collections.abc import Sequence
from functools import cache
from typing import Annotated, Any

import numpy as np

from pfsc_drake.checks import FARTHEST, SHORTEST
from pfsc_drake.errors import require, require_one_of


class Rule:
    """Requirement on a value; ``str`` returns it in words."""

    def allows(self, value: Any) -> bool:
        """Return whether a value is allowed; a value of another type may raise TypeError."""
        raise NotImplementedError

    def check(self, key: str, value: Any) -> None:
        """Refuse a value that is not allowed.

        Args:
            key: Its key, for the message.
            value: The value.

        Raises:
            InputError: As :func:`pfsc_drake.errors.require`.
        """
        try:
            good = bool(self.allows(value))
        except (TypeError, ValueError):  # text instead of a number
            good = False
        require(good, key, value, str(self))

    def json(self) -> dict[str, Any]:
        """Return the JSON schema of the rule."""
        return {}


@dataclasses.dataclass(frozen=True)
class Range(Rule):
    """A number within a range; NaN is never within.

    Attributes:
        least: Smallest number.
        most: Largest number.
        unit: Unit, empty for none.
        open: Whether ``least`` itself is refused.
        below: Whether ``most`` itself is refused.
        besides: A number outside the range that is allowed too, such as 0 for none.
        infinite: Whether infinity stands for no limit.
        words: Allowed values in words, instead of the numbers.
    """

    least: float = -math.inf
    most: float = math.inf
    unit: str = ""
    open: bool = False
    below: bool = False
    besides: float | None = None
    infinite: bool = False
    words: str = ""

    def allows(self, value: Any) -> bool:
        """Return whether a number is within the range."""
        besides = self.besides is not None and value == self.besides
        if besides or (self.infinite and value == math.inf):
            return True
        above = self.least < value if self.open else self.least <= value
        return (
            above and (value < self.most if self.below else value <= self.most) and _finite(value)
        )

    def __str__(self) -> str:
        """Return the range in words."""
        if self.words:
            return self.words
        besides = "" if self.besides is None else f"{self.besides:g}, or "
        unit = f" {self.unit}" if self.unit else ""
        return f"{besides}{self._numbers()}{unit}{', or .inf' if self.infinite else ''}"

    def _numbers(self) -> str:
        """Return both ends in words."""
        least, most = f"{self.least:g}", f"{'below ' if self.below else ''}{self.most:g}"
        if self.most == math.inf:
            return self._one_end()
        if self.least == -math.inf:
            return most if self.below else f"at most {most}"
        if self.open:
            return f"above {least}, {most if self.below else f'at most {most}'}"
        return f"{least} to {most}"

    def _one_end(self) -> str:
        """Return the lower end in words, where there is no upper one."""
        if self.least == -math.inf:
            return "a finite number"
        if self.least == 0.0:
            return "a positive number" if self.open else "zero or a positive number"
        return f"above {self.least:g}" if self.open else f"{self.least:g} or more"

    def json(self) -> dict[str, Any]:
        """Return the range as JSON schema."""
        ends = {
            "exclusiveMinimum" if self.open else "minimum": self.least,
            "exclusiveMaximum" if self.below else "maximum": math.inf
            if self.infinite
            else self.most,
        }
        schema: dict[str, Any] = {key: end for key, end in ends.items() if math.isfinite(end)}
        return schema if self.besides is None else {"anyOf": [{"const": self.besides}, schema]}


@dataclasses.dataclass(frozen=True)
class Numbers(Rule):
    """A list or an array of finite numbers.

    Attributes:
        count: Length; None for any length.
        each: Range of each number.
        fewest: Smallest length, if the length is free.
        empty: Whether the list may be empty although its length is fixed.
        some: Whether at least one number must not be zero.
        words: Allowed values in words, instead of the numbers.
    """

    count: int | None = None
    each: Range = Range()
    fewest: int = 0
    empty: bool = False
    some: bool = False
    words: str = ""

    def allows(self, value: Any) -> bool:
        """Return whether the numbers have the required length and each is allowed."""
        if self.empty and len(value) == 0:
            return True
        shape = np.shape(value)
        fits = len(shape) == 1 and shape[0] >= self.fewest and self.count in (None, *shape)
        return fits and all(map(self.each.allows, value)) and (not self.some or any(value))

    def __str__(self) -> str:
        """Return the allowed values in words."""
        if self.words:
            return self.words
        count = "" if self.count is None else f"{self.count} "
        text = f"{count}numbers, not all zero" if self.some else f"{count}{self._each()}"
        return f"empty, or {text}" if self.empty else text

    def _each(self) -> str:
        """Return the range of each number in words, in the plural."""
        each = self.each
        most = f" at most {each.most:g} {each.unit}".rstrip() if each.most < math.inf else ""
        if each.least == -each.most:
            return f"finite numbers{most and ' of'}{most}"
        if each.least == 0.0:
            kind = "positive numbers" if each.open else "finite numbers, none negative"
            return f"{kind}{most and ','}{most}"
        return f"numbers from {each}"

    def json(self) -> dict[str, Any]:
        """Return the JSON schema of the list."""
        schema: dict[str, Any] = {"minItems": self.fewest} if self.fewest else {}
        if self.count is not None:
            schema = {"minItems": 0 if self.empty else self.count, "maxItems": self.count}
        return {**schema, "items": {"type": "number", **self.each.json()}}


@dataclasses.dataclass(frozen=True)
class Count(Rule):
    """A list, a mapping or a text of some length.

    Attributes:
        least: Fewest items.
        most: Most items; None for any number.
        empty: Whether it may be empty, too.
        words: Allowed values in words, instead of the numbers.
    """

    least: int
    most: int | None = None
    empty: bool = False
    words: str = ""

    def allows(self, value: Any) -> bool:
        """Return whether the length is allowed."""
        if self.empty and len(value) == 0:
            return True
        return self.least <= len(value) and (self.most is None or len(value) <= self.most)

    def check(self, key: str, value: Any) -> None:
        """Refuse too few or too many items; see :meth:`Rule.check`."""
        blocks = any(map(dataclasses.is_dataclass, value))
        require(self.allows(value), key, f"{len(value)} given" if blocks else value, str(self))

    def __str__(self) -> str:
        """Return the allowed lengths in words."""
        return self.words or (
            f"{self.least} to {self.most}" if self.most else f"{self.least} or more"
        )

    def json(self) -> dict[str, Any]:
        """Return the JSON schema of the list."""
        return {"minItems": 0 if self.empty else self.least} | (
            {"maxItems": self.most} if self.most else {}
        )


@dataclasses.dataclass(frozen=True)
class OneOf(Rule):
    """One of several words.

    Attributes:
        allowed: The words.
    """

    allowed: Sequence[str]

    def allows(self, value: Any) -> bool:
        """Return whether a word is allowed."""
        return value in self.allowed

    def check(self, key: str, value: Any) -> None:
        """Refuse any other word, and suggest the nearest; see :meth:`Rule.check`."""
        require_one_of(key, value, self.allowed)

    def __str__(self) -> str:
        """Return the words."""
        return ", ".join(self.allowed)

    def json(self) -> dict[str, Any]:
        """Return the words as JSON schema."""
        return {"enum": list(self.allowed)}


Finite = Annotated[float, Range()]
Positive = Annotated[float, Range(0.0, open=True)]
NotNegative = Annotated[float, Range(0.0)]
Length = Annotated[float, Range(SHORTEST, FARTHEST, "m")]
Seed = Annotated[int, Range(0, words="zero or a positive integer")]
Name = Annotated[str, Count(1, words="a name")]
Point = Annotated[list[float], Numbers(3, Range(-FARTHEST, FARTHEST, "m"))]
Direction = Annotated[list[float], Numbers(3, some=True)]
Pair = Annotated[list[float], Numbers(2)]
MaybePoint = Annotated[list[float], Numbers(3, Range(-FARTHEST, FARTHEST, "m"), empty=True)]
MaybeDirection = Annotated[list[float], Numbers(3, empty=True, some=True)]
NotNegatives = Annotated[list[float], Numbers(each=Range(0.0))]
Positives = Annotated[list[float], Numbers(each=Range(0.0, open=True))]


class Parameters:
    """Base of a dataclass whose fields have rules, checked when it is created.

    A dataclass with checks across fields calls ``super().__post_init__()`` first.
    """

    def __post_init__(self) -> None:
        """Check each field.

        Raises:
            InputError: If a value violates a rule of its field.
        """
        owner: Any = type(self)
        for name, hint in ruled_fields(owner).items():
            check_value(hint, name, getattr(self, name))


def check_value(hint: Any, key: str, value: Any) -> None:
    """Refuse a value that violates a rule of its type, or of inner types.

    Args:
        hint: Its type, with rules; null, if the type allows it, has none.
        key: Its key, for the message.
        value: The value.

    Raises:
        InputError: As :func:`pfsc_drake.errors.require`.
    """
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if value is None:
        return
    if origin is Annotated:
        for rule in rules_of(hint):
            rule.check(key, value)
        check_value(arguments[0], key, value)
    elif origin in (typing.Union, types.UnionType):
        for member in arguments:
            # a word is checked as text, not as one of the numbers that may replace it
            if isinstance(value, str) == (_without_rules(member) is str):
                check_value(member, key, value)
    elif origin is list and isinstance(value, list) and has_rules(arguments[0]):
        for index, item in enumerate(value):
            check_value(arguments[0], f"{key}[{index}]", item)
    elif origin is dict and isinstance(value, dict) and has_rules(arguments[1]):
        for name, item in value.items():
            check_value(arguments[1], f"{key}.{name}", item)


def rules_of(hint: Any) -> list[Rule]:
    """Return the rules of an annotated type."""
    metadata = hint.__metadata__ if typing.get_origin(hint) is Annotated else ()
    return [entry for entry in metadata if isinstance(entry, Rule)]


def has_rules(hint: Any) -> bool:
    """Return whether a type, or one of its inner types, has a rule."""
    return bool(rules_of(hint)) or any(map(has_rules, typing.get_args(hint)))


@cache
def ruled_fields(owner: type) -> dict[str, Any]:
    """Return the types, with rules, of the fields of a dataclass that have rules."""
    hints = typing.get_type_hints(owner, include_extras=True)
    names = [field.name for field in dataclasses.fields(owner)]
    return {name: hints[name] for name in names if has_rules(hints[name])}


def _without_rules(hint: Any) -> Any:
    """Return a type without its rules."""
    return typing.get_args(hint)[0] if typing.get_origin(hint) is Annotated else hint


def _finite(value: Any) -> bool:
    return -math.inf < value < math.inf
