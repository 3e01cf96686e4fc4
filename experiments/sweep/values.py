"""Values of ``--vary KEY=``: a list, a grid, or a random distribution.

===========================  ==================================================================
``0.9,1,1.1``                these values (YAML; commas inside brackets and quotes divide nothing)
``linspace(0.9, 1.1, 5)``    5 values in equal steps, both ends included
``geomspace(1, 100, 3)``     3 values in equal ratios, both ends included
``range(5)``, ``range(2, 7)``  whole numbers as Python counts them: 0 to 4, 2 to 6
``0.9:1.1``                  random, uniform between the two; the same as ``uniform(0.9, 1.1)``
``loguniform(1, 100)``       random, the logarithm uniform between those of the two
``normal(1, 0.05)``          random, mean and standard deviation
``integers(1, 6)``           random whole number from the first to the last
``choice(elastic, rigid)``   random, one of these values
``normal(1, 0.05)*6``        a list of 6 independent draws; behind any random one
===========================  ==================================================================
"""

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pfsc_drake.checks import is_number
from pfsc_drake.errors import InputError, shorten
from pfsc_drake.yaml.reading import parse_yaml

MAX_VALUES = 100_000  # of one key
MAX_LENGTH = 1000  # of a list that is drawn

ALLOWED = (
    "allowed: values a,b,c; linspace(first, last, n), geomspace(first, last, n), range(n); "
    "at random low:high, uniform(low, high), loguniform(low, high), normal(mean, sd), "
    "integers(first, last), choice(a, b, c), each with *n for a list of n"
)

_CALL = re.compile(r"([a-z]+)\((.*)\)", re.DOTALL)
_REPEATED = re.compile(r"(.*[)\d])\s*\*\s*(\d+)", re.DOTALL)
_RANGE = re.compile(r"([^:\[\]{}\"',]+):([^:\[\]{}\"',]+)")
_OPENING, _CLOSING = "([{", ")]}"

Draw = Callable[[np.random.Generator], str]


@dataclass(frozen=True)
class Random:
    """A random distribution.

    Attributes:
        draw: Draws one value.
        length: Length of the list that is drawn; None for a single value.
    """

    draw: Draw
    length: int | None = None

    def sample(self, generator: np.random.Generator) -> str:
        """Return the YAML text of one draw."""
        if self.length is None:
            return self.draw(generator)
        return "[" + ", ".join(self.draw(generator) for _ in range(self.length)) + "]"


def parse_values(text: str, source: str) -> tuple[str, ...] | Random:
    """Read the values of ``--vary KEY=``.

    Args:
        text: Values as on the command line.
        source: The option as given, for messages.

    Returns:
        YAML texts of values, or a distribution.

    Raises:
        InputError: If the text is none of these; names the piece.
    """
    text = text.strip()
    repeated = _REPEATED.fullmatch(text)
    if repeated and _is_random(repeated[1].strip()):
        length = int(repeated[2]) if len(repeated[2]) < 9 else MAX_LENGTH + 1
        if not 1 <= length <= MAX_LENGTH:
            raise InputError(f"{source}: *{repeated[2]}; allowed: a list of 1 to {MAX_LENGTH}")
        return Random(_parse_single(repeated[1].strip(), source).draw, length)
    if _is_random(text):
        return _parse_single(text, source)
    call = _CALL.fullmatch(text)
    if call:
        name, pieces = call[1], split_values(call[2], source)
        if name not in _GRIDS:
            raise InputError(f"{source}: unknown {shorten(name)}(...); {ALLOWED}")
        return _GRIDS[name](name, pieces, source)
    values = tuple(split_values(text, source))
    if len(values) < 2:
        raise InputError(
            f"{source}: one value varies nothing; {ALLOWED} (--set for constant values)"
        )
    _check_number(len(values), source)
    for value in values:
        parse_yaml(value, f"{source}: {shorten(value)}")
    return values


def split_values(text: str, source: str) -> list[str]:
    """Return the pieces between commas outside of brackets and quotes.

    Args:
        text: Text to split.
        source: The option as given, for messages.

    Raises:
        InputError: If brackets or quotes are not closed, or a piece is empty.
    """
    pieces, open_brackets, quote = [""], "", ""
    for character in text:
        if quote:
            quote = "" if character == quote else quote
        elif character in "\"'" and not pieces[-1].strip():
            quote = character
        elif character in _OPENING:
            open_brackets += character
        elif character in _CLOSING:
            expected = _OPENING[_CLOSING.index(character)]
            if not open_brackets.endswith(expected):
                raise InputError(f"{source}: {character} closes nothing")
            open_brackets = open_brackets[:-1]
        elif character == "," and not open_brackets:
            pieces.append("")
            continue
        pieces[-1] += character
    if quote or open_brackets:
        raise InputError(f"{source}: {quote or open_brackets[-1]} is not closed")
    pieces = [piece.strip() for piece in pieces]
    if not all(pieces):
        raise InputError(f"{source}: an empty value; {ALLOWED}")
    return pieces


def number_text(value: float) -> str:
    """Return a number as YAML text without loss of digits."""
    text = repr(float(value))
    # YAML 1.1 takes 1e-05 for a text
    return text.replace("e", ".0e") if "e" in text and "." not in text else text


def _is_random(text: str) -> bool:
    """Return whether a text is a random distribution, well formed or not."""
    call = _CALL.fullmatch(text)
    if call:
        return call[1] in _DISTRIBUTIONS
    ends = _RANGE.fullmatch(text)
    return ends is not None and is_number(ends[1].strip()) and is_number(ends[2].strip())


def _parse_single(text: str, source: str) -> Random:
    call = _CALL.fullmatch(text)
    if call:
        return Random(_DISTRIBUTIONS[call[1]](call[1], split_values(call[2], source), source))
    return Random(_uniform("", text.split(":"), source))


def _numbers(name: str, pieces: Sequence[str], source: str, *names: str) -> list[float]:
    """Return the finite arguments of a function with named parameters."""
    call = f"{name}({', '.join(names)})" if name else ":".join(names)
    if len(pieces) != len(names):
        raise InputError(f"{source}: {len(pieces)} numbers; allowed: {call}")
    for piece in pieces:
        if not (is_number(piece) and math.isfinite(float(piece))):
            raise InputError(f"{source}: {shorten(piece)} is not a finite number; allowed: {call}")
    return [float(piece) for piece in pieces]


def _whole(value: float, source: str) -> int:
    if not (value.is_integer() and abs(value) < 2.0**53):
        raise InputError(f"{source}: {value:g} is no whole number")
    return int(value)


def _check_number(count: int, source: str) -> None:
    if count > MAX_VALUES:
        raise InputError(f"{source}: {count} values; allowed: up to {MAX_VALUES}")


def _uniform(name: str, pieces: Sequence[str], source: str) -> Draw:
    low, high = _ordered(name, pieces, source)
    return lambda generator: number_text(generator.uniform(low, high))


def _loguniform(name: str, pieces: Sequence[str], source: str) -> Draw:
    low, high = _ordered(name, pieces, source)
    if low <= 0.0:
        raise InputError(f"{source}: {pieces[0]}; allowed: {name}(low, high) with low > 0")
    logarithms = math.log(low), math.log(high)
    return lambda generator: number_text(math.exp(generator.uniform(*logarithms)))


def _normal(name: str, pieces: Sequence[str], source: str) -> Draw:
    mean, deviation = _numbers(name, pieces, source, "mean", "sd")
    if deviation <= 0.0:
        raise InputError(f"{source}: sd = {deviation:g}; allowed: > 0")
    return lambda generator: number_text(generator.normal(mean, deviation))


def _integers(name: str, pieces: Sequence[str], source: str) -> Draw:
    first, last = (_whole(v, source) for v in _numbers(name, pieces, source, "first", "last"))
    if first >= last:
        raise InputError(f"{source}: {first} to {last}; allowed: first < last")
    return lambda generator: str(int(generator.integers(first, last, endpoint=True)))


def _choice(name: str, pieces: Sequence[str], source: str) -> Draw:
    if len(pieces) < 2:
        raise InputError(f"{source}: one value varies nothing; allowed: {name}(a, b, c)")
    for piece in pieces:
        parse_yaml(piece, f"{source}: {shorten(piece)}")
    return lambda generator: pieces[int(generator.integers(len(pieces)))]


def _ordered(name: str, pieces: Sequence[str], source: str) -> tuple[float, float]:
    low, high = _numbers(name, [piece.strip() for piece in pieces], source, "low", "high")
    if low >= high:
        raise InputError(f"{source}: {low:g} to {high:g}; allowed: low < high")
    return low, high


def _space(name: str, pieces: Sequence[str], source: str) -> tuple[str, ...]:
    first, last, count = _numbers(name, pieces, source, "first", "last", "n")
    number = _whole(count, source)
    if number < 2:
        raise InputError(f"{source}: {number} values; allowed: two or more")
    _check_number(number, source)
    if name == "linspace":
        return tuple(number_text(value) for value in np.linspace(first, last, number))
    if first <= 0.0 or last <= 0.0:
        raise InputError(f"{source}: {first:g} to {last:g}; allowed: both > 0")
    return tuple(number_text(value) for value in np.geomspace(first, last, number))


def _counted(name: str, pieces: Sequence[str], source: str) -> tuple[str, ...]:
    names = ("n",) if len(pieces) == 1 else ("first", "after")
    bounds = [_whole(value, source) for value in _numbers(name, pieces, source, *names)]
    counted = range(*bounds)
    if len(counted) < 2:
        raise InputError(f"{source}: {len(counted)} values; allowed: two or more")
    _check_number(len(counted), source)
    return tuple(str(value) for value in counted)


_GRIDS: dict[str, Callable[[str, Sequence[str], str], tuple[str, ...]]] = {
    "linspace": _space,
    "geomspace": _space,
    "range": _counted,
}
_DISTRIBUTIONS: dict[str, Callable[[str, Sequence[str], str], Draw]] = {
    "uniform": _uniform,
    "loguniform": _loguniform,
    "normal": _normal,
    "integers": _integers,
    "choice": _choice,
}


def column_value(text: str) -> Any:
    """Return a YAML value for a table: a number, or else its text.

    Args:
        text: One YAML value.
    """
    value = parse_yaml(text, text)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return float(value) if isinstance(value, str) and is_number(value) else text
    return value
