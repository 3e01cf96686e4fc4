"""Messages about values that do not fit a schema."""

import collections.abc
import dataclasses
import re
import sys
import types
import typing
from pathlib import Path
from typing import Any

import numpy as np

from pfsc_drake.checks import NUMBER
from pfsc_drake.errors import shorten
from pfsc_drake.yaml.fields import fields_of

MAX_INTEGER = 2**63 - 1
_LONG_INTEGER = re.compile(r"[-+]?[0-9]+")
SCALARS: dict[Any, str] = {
    bool: "true or false",
    int: "an integer",
    float: "a number",
    str: "text",
    Path: "a path (text)",
}


def range_of_type(kind: Any, value: Any) -> str:
    """Return the range of a type in words, where a number was refused for its size."""
    if isinstance(value, str):
        beyond = bool((NUMBER if kind is float else _LONG_INTEGER).fullmatch(value))
    else:
        beyond = type(value) is int or (type(value) is float and value.is_integer())
    if kind is float and beyond:
        return f" of magnitude up to {sys.float_info.max:.2g}"
    return f" of magnitude up to {MAX_INTEGER}" if kind is int and beyond else ""


def decimal_comma(mapping: dict[Any, Any], name: Any) -> str:
    """Return a hint for ``{velocity: 0,3}``, where YAML reads a key 3 without value."""
    names = list(mapping)
    index = names.index(name)
    if type(name) is not int or mapping[name] is not None or not index:
        return ""
    before = names[index - 1]
    if type(mapping[before]) is not int:
        return ""
    return f"a decimal comma? write {before}: {mapping[before]}.{name} "


def expectation(kind: Any) -> str:
    """Return the values of a type in words."""
    if kind in SCALARS:
        return SCALARS[kind]
    if kind is np.ndarray:
        return "a list of numbers"
    if kind is types.NoneType:
        return "null"
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        return " or ".join(alternatives(arguments))
    if origin is list:
        return f"a list (each item {expectation(arguments[0])})"
    if origin in (dict, collections.abc.Mapping):
        return f"a mapping (each value {expectation(arguments[1])})"
    return f"a mapping with the keys {', '.join(fields_of(kind))}"


def alternatives(members: tuple[Any, ...]) -> list[str]:
    """Return the values of each member of a union in words."""
    several = sum(dataclasses.is_dataclass(member) for member in members) > 1
    return [
        f"!{member.__name__} {{...}}"
        if several and isinstance(member, type) and dataclasses.is_dataclass(member)
        else expectation(member)
        for member in members
    ]


def value_text(value: Any) -> str:
    """Return a value as written in YAML, shortened to fit a line."""
    if value is None:
        return "empty (null)"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int) and abs(value) > MAX_INTEGER:
        return f"an integer of {value.bit_length()} bits"
    try:
        return shorten(repr(value))
    except ValueError:  # an integer inside, of more digits than Python writes
        return f"a {type(value).__name__}"
