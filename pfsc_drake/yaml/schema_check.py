"""Walks data along a dataclass schema and reports every key that does not fit."""

import collections.abc
import dataclasses
import math
import re
import sys
import types
import typing
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pfsc_drake.checks import NUMBER
from pfsc_drake.errors import InputError, did_you_mean, in_one_line, shortened
from pfsc_drake.yaml.reading import TAG_KEY

REQUIRED = {"required": True}  # metadata of a field whose key may not be left out

Place = tuple[Any, ...]

_MOST_MISFITS = 50  # of one file
_INFINITY = re.compile(r"[-+]?inf(inity)?", re.IGNORECASE)
_INTEGER = re.compile(r"[-+]?[0-9]{1,19}")
_LONG_INTEGER = re.compile(r"[-+]?[0-9]+")
_MAX_INTEGER = 2**63 - 1
_MAX_NUMBER = sys.float_info.max

_SCALAR_NAMES: dict[Any, str] = {
    bool: "true or false",
    int: "an integer",
    float: "a number",
    str: "text",
    Path: "a path (text)",
}


class Misfit(NamedTuple):
    """What does not fit a schema.

    Attributes:
        place: Keys and indices that lead to it.
        message: What is there and what is allowed, without the file's name.
    """

    place: Place
    message: str


def check_schema(schema: type, data: Any, source: str) -> None:
    """Checks data against a schema, by the rules of Drake's ``yaml_load_typed``.

    Args:
        schema: Dataclass. Its fields are keys; a field without default, or with
            ``metadata=REQUIRED``, must be there.
        data: As :func:`pfsc_drake.yaml.reading.read_yaml` returns it.
        source: Name of the file, for messages.

    Raises:
        InputError: One line that names source, and of all that does not fit key path, value and
            what is allowed.
    """
    misfits = find_misfits(schema, data)
    if misfits:
        raise InputError(f"{source}: {in_one_line([misfit.message for misfit in misfits])}")


def find_misfits(schema: type, data: Any) -> list[Misfit]:
    """Returns what does not fit a schema, in the order of the file; see :func:`check_schema`."""
    checker = _Checker()
    checker.check(schema, data, ())
    return checker.misfits


class _Checker:
    """The walk; ``place`` is the way so far, e.g. ``("controller", "gains", "eta", 1)``."""

    def __init__(self) -> None:
        self.misfits: list[Misfit] = []

    def check(self, schema: Any, value: Any, place: Place) -> None:
        """Checks one value against the type of its field."""
        origin, arguments = typing.get_origin(schema), typing.get_args(schema)
        if dataclasses.is_dataclass(schema):
            self._check_dataclass(schema, value, place)
        elif schema in _SCALAR_NAMES:
            if not _is_scalar(schema, value):
                self._refuse(value, place, _expected(schema) + _range(schema, value))
        elif schema is np.ndarray:
            self._check_array(value, place)
        elif origin in (typing.Union, types.UnionType):
            self._check_union(arguments, value, place)
        elif origin is list:
            if not isinstance(value, list):
                self._refuse(value, place, _expected(schema))
                return
            for index, item in enumerate(value):
                self.check(arguments[0], item, (*place, index))
        elif origin in (dict, collections.abc.Mapping):
            if not isinstance(value, dict):
                self._refuse(value, place, _expected(schema))
                return
            for name, item in value.items():
                if isinstance(name, str):
                    self.check(arguments[1], item, (*place, name))
                else:
                    what = f"key '{spelled((*place, str(name)))}' is {_shown(name)}"
                    self._add(place, f"{what}: expected a key that is text")

    def _check_dataclass(self, schema: Any, value: Any, place: Place) -> None:
        """Checks the keys of a mapping, then their values."""
        hints = typing.get_type_hints(schema)
        fields = {field.name: field for field in dataclasses.fields(schema)}
        if not isinstance(value, dict):
            self._refuse(value, place, f"a mapping with the keys {', '.join(fields)}")
            return
        if TAG_KEY in value:
            self._refuse(value[TAG_KEY], place, "a mapping without a tag")
            return
        for name, item in value.items():
            here = (*place, name)
            if name not in fields:
                allowed = ", ".join(fields) or "no keys"
                hint = _decimal_comma(value, name) or did_you_mean(name, fields)
                what = f"unknown key '{spelled((*place, str(name)))}' = {_shown(item)}"
                self._add(here, f"{what}: {hint}allowed: {allowed}")
            elif "words" in fields[name].metadata and isinstance(item, list):
                self._check_words(fields[name].metadata["words"], item, here)
            elif _takes_a_number(fields[name]) and not isinstance(item, list):
                word = fields[name].metadata.get("empty_word")
                single = f"a number, {word}" if word else "a number"
                self._refuse(item, here, f"{single} or {_expected(hints[name])}")
            else:
                self.check(hints[name], item, here)
        for name, field in fields.items():
            if name not in value and _is_required(field):
                here = (*place, name)
                expected = _expected(hints[name])
                self._add(here, f"missing key '{spelled(here)}': expected {expected}")

    def _check_words(self, words: Sequence[str], values: list[Any], place: Place) -> None:
        """Checks a list of numbers in which some words may stand."""
        for index, item in enumerate(values):
            if item not in words and not _is_scalar(float, item):
                hint = did_you_mean(item, words) if isinstance(item, str) else ""
                self._refuse(item, (*place, index), f"a number or {' or '.join(words)}", hint)

    def _check_union(self, members: tuple[Any, ...], value: Any, place: Place) -> None:
        """Checks an optional value, a choice of scalars, or of dataclasses by tag."""
        choices = [member for member in members if member is not type(None)]
        _require_no_subclasses(choices)
        if value is None:
            if len(choices) == len(members):
                self._refuse(value, place, " or ".join(_alternatives(members)))
        elif len(choices) == 1:
            self.check(choices[0], value, place)
        elif isinstance(value, dict) and TAG_KEY in value:
            by_tag = {f"!{getattr(choice, '__name__', choice)}": choice for choice in choices}
            tag = str(value[TAG_KEY])
            if tag not in by_tag:
                what = f"key '{spelled(place)}': unknown tag {tag}"
                allowed = ", ".join(by_tag)
                self._add(place, f"{what}: {did_you_mean(tag, by_tag)}allowed: {allowed}")
                return
            content = {name: item for name, item in value.items() if name != TAG_KEY}
            self.check(by_tag[tag], content, place)
        elif isinstance(value, (dict, list)):
            self._check_untagged(choices, value, place)
        elif type(value) not in choices and not _is_scalar(choices[0], value):
            self._refuse(value, place, " or ".join(_alternatives(members)))

    def _check_untagged(self, choices: list[Any], value: Any, place: Place) -> None:
        """Checks a mapping or list without tag, which is read as the first choice."""
        before = len(self.misfits)
        self.check(choices[0], value, place)
        if len(self.misfits) > before:
            others = [f"!{choice.__name__}" for choice in choices[1:] if isinstance(choice, type)]
            first = f"!{getattr(choices[0], '__name__', choices[0])}"
            hint = f"(without a tag '{spelled(place)}' is {first}; other tags: {', '.join(others)})"
            told = self.misfits[before]
            self.misfits[before] = told._replace(message=f"{told.message} {hint}")

    def _check_array(self, value: Any, place: Place) -> None:
        """Checks a vector, or a matrix as a list of equally long rows."""
        if not isinstance(value, list):
            self._refuse(value, place, _expected(np.ndarray))
            return
        rows = [item for item in value if isinstance(item, list)]
        if rows and len({len(row) if isinstance(row, list) else -1 for row in value}) > 1:
            self._refuse(value, place, "rows of equal length")
            return
        for index, item in enumerate(value):
            if isinstance(item, list):
                self._check_array(item, (*place, index))
            else:
                self.check(float, item, (*place, index))

    def _refuse(self, value: Any, place: Place, expected: str, hint: str = "") -> None:
        """Adds a value that does not fit."""
        where = f"key '{spelled(place)}'" if place else "the root"
        self._add(place, f"{where} is {_shown(value)}: {hint}expected {expected}")

    def _add(self, place: Place, message: str) -> None:
        if len(self.misfits) < _MOST_MISFITS:
            self.misfits.append(Misfit(place, message))


def _decimal_comma(mapping: dict[Any, Any], name: Any) -> str:
    """Return what to write for ``{velocity: 0,3}``, where YAML reads a key 3 without value."""
    names = list(mapping)
    place = names.index(name)
    if type(name) is not int or mapping[name] is not None or not place:
        return ""
    before = names[place - 1]
    if type(mapping[before]) is not int:
        return ""
    return f"a decimal comma? write {before}: {mapping[before]}.{name} "


def spelled(place: Place) -> str:
    """Returns a place as a path of keys, e.g. ``controller.gains.eta[1]``."""
    text = ""
    for step in place:
        text += f"[{step}]" if type(step) is int and text else f".{step}" if text else f"{step}"
    return text


def _is_scalar(schema: Any, value: Any) -> bool:
    """Whether Drake converts the YAML value to the scalar type; NaN is refused."""
    kind = type(value)
    if schema is bool:
        return kind is bool or value in ("true", "false")
    if schema is int:
        if kind is float:
            return value.is_integer() and abs(value) <= _MAX_INTEGER
        whole = kind is int or (kind is str and bool(_INTEGER.fullmatch(value)))
        return whole and abs(int(value)) <= _MAX_INTEGER
    if schema is float:
        return kind in (int, float, str) and is_number(value)
    return schema in (str, Path) and kind is str


def is_number(value: float | str) -> bool:
    """Whether a number, or text that is one, fits a float; infinity does, NaN does not.

    YAML 1.1 reads 1e-3 as text.
    """
    if isinstance(value, str) and not NUMBER.fullmatch(value):
        return bool(_INFINITY.fullmatch(value))
    try:
        number = float(value)
    except OverflowError:
        return False
    # text beyond the largest float is read as infinite, which is not what it says
    return not math.isnan(number) and not (isinstance(value, str) and math.isinf(number))


def _range(schema: Any, value: Any) -> str:
    """What numbers a field allows, where a number was refused for its size."""
    if isinstance(value, str):
        beyond = bool((NUMBER if schema is float else _LONG_INTEGER).fullmatch(value))
    else:
        beyond = type(value) is int or (type(value) is float and value.is_integer())
    if schema is float and beyond:
        return f" of magnitude up to {_MAX_NUMBER:.2g}"
    return f" of magnitude up to {_MAX_INTEGER}" if schema is int and beyond else ""


def _require_no_subclasses(choices: list[Any]) -> None:
    """Raises NotImplementedError at a member of a union that is a subclass of another one.

    Drake takes an instance of a subclass for one of its base: where the default is of the subclass
    a value with the tag of the base becomes one of the subclass.
    """
    kinds = [kind for kind in choices if isinstance(kind, type) and dataclasses.is_dataclass(kind)]
    for kind in kinds:
        if any(base is not kind and issubclass(kind, base) for base in kinds):
            raise NotImplementedError(f"{kind.__name__} is a subclass of what it stands beside")


def _is_required(field: "dataclasses.Field[Any]") -> bool:
    """Whether a key may not be left out."""
    no_default = field.default is field.default_factory is dataclasses.MISSING
    return no_default or bool(field.metadata.get("required"))


def _takes_a_number(field: "dataclasses.Field[Any]") -> bool:
    """Whether a number may stand for a list; see :mod:`pfsc_drake.yaml.broadcast`."""
    return any(key in field.metadata for key in ("one_or_many", "one_for_all", "equal"))


def _expected(schema: Any) -> str:
    """What a field allows, in words."""
    if schema in _SCALAR_NAMES:
        return _SCALAR_NAMES[schema]
    if schema is np.ndarray:
        return "a list of numbers"
    if schema is type(None):
        return "null"
    origin, arguments = typing.get_origin(schema), typing.get_args(schema)
    if origin in (typing.Union, types.UnionType):
        return " or ".join(_alternatives(arguments))
    if origin is list:
        return f"a list (each item {_expected(arguments[0])})"
    if origin in (dict, collections.abc.Mapping):
        return f"a mapping (each value {_expected(arguments[1])})"
    if dataclasses.is_dataclass(schema):
        return f"a mapping with the keys {', '.join(f.name for f in dataclasses.fields(schema))}"
    return str(schema)


def _alternatives(members: tuple[Any, ...]) -> list[str]:
    """What each member of a union allows, in words."""
    several = sum(dataclasses.is_dataclass(member) for member in members) > 1
    return [
        f"!{member.__name__} {{...}}"
        if several and isinstance(member, type) and dataclasses.is_dataclass(member)
        else _expected(member)
        for member in members
    ]


def _shown(value: Any) -> str:
    """A value as written in YAML, shortened to fit a line."""
    if value is None:
        return "empty (null)"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int) and abs(value) > _MAX_INTEGER:
        return f"an integer of {value.bit_length()} bits"
    try:
        return shortened(repr(value))
    except ValueError:  # an integer inside, of more digits than Python writes
        return f"a {type(value).__name__}"
