"""Rules of values, declared on the fields of dataclasses that people fill in.

A rule is the metadata of an annotated type, and is declared once for everybody who needs it: it is
checked where an object is made, in Python or from a file (:mod:`pfsc_drake.yaml.typed`), and told
by the reference of keys and the JSON schema of editors (:mod:`pfsc_drake.yaml.json_schema`)::

    @dataclass
    class Tank(Parameters):
        capacity: Positive = 4.0
        initial: Annotated[float, Range(0.0, 10.0, "J")] = 0.2
        kind: Annotated[str, OneOf(KINDS)] = "soft"

        def __post_init__(self) -> None:
            super().__post_init__()  # what each field allows, then what they allow each other
            require(self.initial <= self.capacity, "initial", self.initial, "capacity or less")
"""

import dataclasses
import math
import types
import typing
from collections.abc import Iterator, Sequence
from functools import cache
from typing import Annotated, Any

import numpy as np

from pfsc_drake.errors import require, require_one_of


class Rule:
    """What a value must be; ``str`` of it says so in words."""

    def allows(self, value: Any) -> bool:
        """Return whether a value is allowed; one of another type may raise TypeError."""
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
        except (TypeError, ValueError):  # text where there must be a number
            good = False
        shown = value.tolist() if isinstance(value, np.ndarray) else value
        require(good, key, shown, str(self))

    def json(self) -> dict[str, Any]:
        """Return what a JSON schema says of a value."""
        return {}


@dataclasses.dataclass(frozen=True)
class Range(Rule):
    """A number within a range; NaN is in none.

    Attributes:
        least: Smallest number.
        most: Largest number.
        unit: Unit, empty for none.
        open: Whether ``least`` itself is refused.
        below: Whether ``most`` itself is refused.
        besides: A number outside that is allowed, too, such as 0 for none.
        infinite: Whether infinity stands for no limit.
        words: What is allowed, where it is not to be said as numbers.
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
        if value == self.besides or (self.infinite and value == math.inf):
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
        least, most = f"{self.least:g}", f"{self.most:g}"
        if self.least == -math.inf and self.most == math.inf:
            return "a finite number"
        if self.most == math.inf:
            positive = "a positive number" if self.open else "zero or a positive number"
            return (
                positive
                if self.least == 0.0
                else f"above {least}"
                if self.open
                else f"{least} or more"
            )
        end = "below" if self.below else "at most"
        if self.least == -math.inf:
            return f"{end} {most}"
        if self.open or self.below:
            return f"{'above' if self.open else 'from'} {least}, {end} {most}"
        return f"{least} to {most}"

    def json(self) -> dict[str, Any]:
        """Return the range as a JSON schema has it."""
        ends = {
            "exclusiveMinimum" if self.open else "minimum": self.least,
            "exclusiveMaximum" if self.below else "maximum": math.inf
            if self.infinite
            else self.most,
        }
        said: dict[str, Any] = {key: end for key, end in ends.items() if math.isfinite(end)}
        return said if self.besides is None else {"anyOf": [{"const": self.besides}, said]}


@dataclasses.dataclass(frozen=True)
class Numbers(Rule):
    """A list or an array of finite numbers.

    Attributes:
        count: How many they are; None for any number of them.
        most: Largest magnitude.
        unit: Unit, empty for none.
        least: Smallest number, if not the largest magnitude bounds both sides.
        open: Whether ``least`` itself is refused.
        empty: Whether there may be none.
        some: Whether one must not be zero.
        words: What is allowed, where it is not to be said as numbers.
    """

    count: int | None = None
    most: float = math.inf
    unit: str = ""
    least: float | None = None
    open: bool = False
    empty: bool = False
    some: bool = False
    words: str = ""

    @property
    def each(self) -> Range:
        """What each of them may be."""
        least = -self.most if self.least is None else self.least
        return Range(least, self.most, self.unit, self.open)

    def allows(self, value: Any) -> bool:
        """Return whether numbers are as many as is said, and each is allowed."""
        if self.empty and len(value) == 0:
            return True
        fits = self.count is None or np.shape(value) == (self.count,)
        return fits and all(map(self.each.allows, value)) and (not self.some or any(value))

    def __str__(self) -> str:
        """Return what is allowed in words."""
        if self.words:
            return self.words
        count = "" if self.count is None else f"{self.count} "
        size = f" of at most {self.most:g} {self.unit}".rstrip() if self.most < math.inf else ""
        if self.some:
            said = f"{count}numbers, not all zero"
        elif self.least is None:
            said = f"{count}finite numbers{size}"
        elif self.least == 0.0:
            at_most = f", at most {self.most:g} {self.unit}".rstrip() if size else ""
            said = (
                f"{count}positive numbers{at_most}"
                if self.open
                else f"{count}finite numbers, none negative{at_most}"
            )
        else:
            said = f"{count}numbers from {self.least:g} to {self.most:g} {self.unit}".rstrip()
        return f"empty, or {said}" if self.empty else said

    def json(self) -> dict[str, Any]:
        """Return what a JSON schema says of the list."""
        said: dict[str, Any] = {}
        if self.count is not None:
            said = {"minItems": 0 if self.empty else self.count, "maxItems": self.count}
        each = self.each.json()
        return {**said, "items": {"type": "number", **each}} if each else said


@dataclasses.dataclass(frozen=True)
class Count(Rule):
    """A list, a mapping or a text of some length.

    Attributes:
        least: Fewest items.
        most: Most items; None for any number.
        words: What is allowed.
    """

    least: int
    most: int | None = None
    words: str = ""

    def allows(self, value: Any) -> bool:
        """Return whether there are as many items as is said."""
        return self.least <= len(value) and (self.most is None or len(value) <= self.most)

    def check(self, key: str, value: Any) -> None:
        """Refuse too few or too many; see :meth:`Rule.check`."""
        shown = "none" if len(value) == 0 else f"{len(value)} given"
        require(self.allows(value), key, shown, str(self))

    def __str__(self) -> str:
        """Return what is allowed in words."""
        return self.words or (
            f"{self.least} to {self.most}" if self.most else f"{self.least} or more"
        )

    def json(self) -> dict[str, Any]:
        """Return what a JSON schema says of the list."""
        return {"minItems": self.least} | ({"maxItems": self.most} if self.most else {})


@dataclasses.dataclass(frozen=True)
class OneOf(Rule):
    """One of several words.

    Attributes:
        allowed: The words.
    """

    allowed: Sequence[str]

    def allows(self, value: Any) -> bool:
        """Return whether a word is one of those that are allowed."""
        return value in self.allowed

    def check(self, key: str, value: Any) -> None:
        """Refuse another word, and name the nearest; see :meth:`Rule.check`."""
        require_one_of(key, value, self.allowed)

    def __str__(self) -> str:
        """Return the words."""
        return ", ".join(self.allowed)

    def json(self) -> dict[str, Any]:
        """Return the words as a JSON schema has them."""
        return {"enum": list(self.allowed)}


Positive = Annotated[float, Range(0.0, open=True)]
NotNegative = Annotated[float, Range(0.0)]
Seed = Annotated[int, Range(0, words="zero or a positive integer")]


class Parameters:
    """Base of a dataclass whose fields have rules: it is checked as it is made.

    A dataclass with checks across fields calls ``super().__post_init__()`` first.
    """

    def __post_init__(self) -> None:
        """Check each field.

        Raises:
            InputError: If one has a value that its rules refuse.
        """
        owner: Any = type(self)
        for name, rules in field_rules(owner).items():
            check_rules(rules, name, getattr(self, name))


def check_rules(rules: Sequence[Rule], key: str, value: Any) -> None:
    """Refuse a value that one of its rules refuses; null, where a type has it, has none.

    Raises:
        InputError: As :func:`pfsc_drake.errors.require`.
    """
    for rule in rules if value is not None else ():
        rule.check(key, value)


@cache
def field_rules(owner: type) -> dict[str, tuple[Rule, ...]]:
    """Return the rules of the fields of a dataclass, of those that have any."""
    hints = typing.get_type_hints(owner, include_extras=True)
    found = {name: tuple(_rules_of(hint)) for name, hint in hints.items()}
    names = {field.name for field in dataclasses.fields(owner)}
    return {name: rules for name, rules in found.items() if rules and name in names}


def _rules_of(hint: Any) -> Iterator[Rule]:
    """Yield the rules of an annotated type, or of those that a union is made of."""
    origin = typing.get_origin(hint)
    if origin is Annotated:
        yield from (entry for entry in hint.__metadata__ if isinstance(entry, Rule))
    elif origin in (typing.Union, types.UnionType):
        for member in typing.get_args(hint):
            yield from _rules_of(member)


def _finite(value: Any) -> bool:
    return -math.inf < value < math.inf
