"""Typed YAML: files and data into dataclasses, with errors a person can act on.

The format is that of Drake's ``yaml_load_typed``, whose messages name neither file nor key: what a
file does not say keeps its default, in blocks within blocks, too; a tag chooses a member of a
union; text that is a number is one. Beyond it a single number or a word may stand for a list
(:mod:`pfsc_drake.yaml.fields`), and NaN is none.
"""

import collections.abc
import dataclasses
import re
import types
import typing
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from pfsc_drake.checks import is_number
from pfsc_drake.errors import InputError, did_you_mean, gathered_refusals, in_one_line
from pfsc_drake.yaml.fields import Field, OneForAll, fields_of
from pfsc_drake.yaml.misfits import (
    MAX_INTEGER,
    SCALARS,
    Place,
    alternatives,
    decimal_comma,
    expectation,
    range_of_type,
    shown,
    spelled,
)
from pfsc_drake.yaml.reading import TAG_KEY, read_yaml
from pfsc_drake.yaml.rules import check_value

Schema = TypeVar("Schema")

_MOST_MISFITS = 50  # of one file
_INTEGER = re.compile(r"[-+]?[0-9]{1,19}")
# of calculations with numbers that are out of bounds
_CONSEQUENCES = (ArithmeticError, ValueError, MemoryError)
# in place of a value that is refused
_REFUSED: Any = object()


def load_file(schema_class: type[Schema], path: str | Path) -> Schema:
    """Loads a YAML file into a schema of dataclasses; see :func:`load_typed`.

    Raises:
        InputError: if the file cannot be read (:func:`pfsc_drake.yaml.reading.read_yaml`) or does
            not fit; one line that names the file.
    """
    return load_typed(schema_class, read_yaml(Path(path)), str(path))


def load_typed(schema_class: type[Schema], data: dict[str, Any], source: str) -> Schema:
    """Loads data into a schema of dataclasses.

    Fields may be bool, int, float, str, Path, numpy array, list, ``dict[str, T]``, Optional, nested
    dataclasses and unions of dataclasses (chosen by a YAML tag, the first member without one; none
    a subclass of another). A dataclass is made, innermost first, once all that is in it fits; its
    ``__post_init__`` checks it by raising InputError.

    Args:
        schema_class: Dataclass. A key that may not be left out has no default, or is declared as
            ``field(default=..., metadata=REQUIRED)``.
        data: As :func:`pfsc_drake.yaml.reading.read_yaml` returns it; it stays as it is.
        source: Name of the file, for messages.

    Returns:
        An instance of ``schema_class``.

    Raises:
        InputError: One line that names source, and of everything that is wrong key path, value and
            what is allowed. What contains something wrong is not judged itself, but for the rules
            of its other fields.
    """
    reader = _Reader()
    result = reader.block(schema_class, data, (), None)
    problems = reader.misfits + reader.refusals
    if problems:
        raise InputError(f"{source}: {in_one_line(problems)}")
    return result


class _Reader:
    """The walk along a schema: makes values, or notes what is wrong and returns _REFUSED.

    Attributes:
        misfits: What does not fit the schema, in the order of the file.
        refusals: Values that fit and are refused.
    """

    def __init__(self) -> None:
        self.misfits: list[str] = []
        self.refusals: list[str] = []

    def block(self, schema: Any, data: Any, place: Place, base: Any) -> Any:
        """Return a dataclass.

        Args:
            schema: Its class.
            data: Mapping of its keys.
            place: Where it is.
            base: Instance whose values stay where a key is missing; None for the defaults.
        """
        fields = fields_of(schema)
        if not isinstance(data, dict):
            return self._misfit(data, place, expectation(schema))
        if TAG_KEY in data:
            return self._misfit(data[TAG_KEY], place, "a mapping without a tag")
        values = {}
        for name, item in data.items():
            here = (*place, name)
            if name in fields:
                values[name] = self._field(fields[name], item, here, base)
            else:
                values[name] = self._unknown(data, name, here, fields)
        for name, field in fields.items():
            if name not in data and field.required:
                here = (*place, name)
                values[name] = self._note(
                    f"missing key '{spelled(here)}': expected {expectation(field.kind)}"
                )
        return self._made(schema, values, place, base)

    def _made(self, schema: Any, values: dict[str, Any], place: Place, base: Any) -> Any:
        """Return a dataclass of values, or note which of them are refused."""
        fields, result = fields_of(schema), _REFUSED
        good = {name: value for name, value in values.items() if value is not _REFUSED}
        beyond = {
            name: f"key '{spelled((*place, name))}' is {number:g}: expected a number from {bounds}"
            for key, value in good.items()
            for bounds in [fields[key].bounds]
            for name, number in fields[key].out_of_bounds(value)
        }
        # what comes of numbers out of bounds says nothing, unless it is about them
        ignored = _CONSEQUENCES if beyond else ()
        with suppress(*ignored), np.errstate(all="ignore"), gathered_refusals() as said:
            if len(good) < len(values):
                for name, value in good.items():
                    check_value(fields[name].hint, name, value)
            else:
                result = schema(**good) if base is None else dataclasses.replace(base, **good)
        told = " ".join(said)
        named = all(re.search(rf"\b{re.escape(key.partition('[')[0])}\b", told) for key in beyond)
        where = f"key '{spelled(place)}': " if place else ""
        found = [f"{where}{' '.join(one.split())}" for one in said] if named else [*beyond.values()]
        self.refusals += found
        return _REFUSED if found else result

    def _field(self, field: Field, item: Any, place: Place, base: Any) -> Any:
        """Return the value of a field, from what stands for a list, too."""
        form = field.form
        if item == form.get("empty_word", ...):
            return []
        if form.get("one_for_all") and _is_number(item):
            return OneForAll([float(item)])
        if form.get("one_or_many") and (_is_number(item) or isinstance(item, str)):
            item = [item]
        count, parts = form.get("equal", 0), form.get("parts", 1)
        if count and _is_number(item):
            item = [item] * count
        elif parts > 1 and isinstance(item, list) and len(item) == parts:
            item = [entry for entry in item for _ in range(count // parts)]
        if "words" in form and isinstance(item, list):
            return self._words(form["words"], item, place)
        if field.takes_a_number and not isinstance(item, list):
            word = form.get("empty_word")
            single = f"a number, {word}" if word else "a number"
            return self._misfit(item, place, f"{single} or {expectation(field.kind)}")
        # what is not said stays in a block or a mapping
        old = None
        if isinstance(item, dict):
            old = (
                getattr(base, field.name) if base is not None else field.default and field.default()
            )
        return self.value(field.kind, item, place, old)

    def value(self, kind: Any, data: Any, place: Place, old: Any) -> Any:
        """Return a value of a type.

        Args:
            kind: The type.
            data: What the file has.
            place: Where it is.
            old: Value that it changes, if it is a mapping; None for none.
        """
        origin, arguments = typing.get_origin(kind), typing.get_args(kind)
        if dataclasses.is_dataclass(kind):
            return self.block(kind, data, place, old)
        if kind in SCALARS:
            found = _scalar(kind, data)
            if found is _REFUSED:
                self._misfit(data, place, expectation(kind) + range_of_type(kind, data))
            return found
        if origin in (typing.Union, types.UnionType):
            return self._union(arguments, data, place, old)
        if kind is np.ndarray:
            rows = self._rows(data, place)
            return rows if rows is _REFUSED else np.array(rows, dtype=float)
        if origin is list:
            if not isinstance(data, list):
                return self._misfit(data, place, expectation(kind))
            items = [self.value(arguments[0], x, (*place, i), None) for i, x in enumerate(data)]
            return _REFUSED if any(item is _REFUSED for item in items) else items
        if origin in (dict, collections.abc.Mapping):
            return self._mapping(kind, data, place, old or {})
        raise NotImplementedError(f"{kind} is no type of a schema")

    def _mapping(self, kind: Any, data: Any, place: Place, old: dict[str, Any]) -> Any:
        """Return a mapping of names; those that it has already stay."""
        if not isinstance(data, dict):
            return self._misfit(data, place, expectation(kind))
        found, item_kind = dict(old), typing.get_args(kind)[1]
        for name, item in data.items():
            if isinstance(name, str):
                found[name] = self.value(item_kind, item, (*place, name), old.get(name))
            else:
                what = f"key '{spelled((*place, str(name)))}' is {shown(name)}"
                found[name] = self._note(f"{what}: expected a key that is text")
        return _REFUSED if any(item is _REFUSED for item in found.values()) else found

    def _union(self, members: tuple[Any, ...], data: Any, place: Place, old: Any) -> Any:
        """Return an optional value, one of several scalars, or a dataclass by its tag."""
        choices = [member for member in members if member is not types.NoneType]
        _require_no_subclasses(choices)
        if data is None and len(choices) < len(members):
            return None
        if len(choices) == 1 and data is not None:
            return self.value(choices[0], data, place, old)
        if isinstance(data, dict) and TAG_KEY in data:
            by_tag = {f"!{getattr(choice, '__name__', choice)}": choice for choice in choices}
            tag = str(data[TAG_KEY])
            if tag not in by_tag:
                hint = f"{did_you_mean(tag, by_tag)}allowed: {', '.join(by_tag)}"
                return self._note(f"key '{spelled(place)}': unknown tag {tag}: {hint}")
            kind = by_tag[tag]
            content = {name: item for name, item in data.items() if name != TAG_KEY}
            return self.value(kind, content, place, old if type(old) is kind else None)
        if isinstance(data, (dict, list)):
            return self._untagged(choices, data, place, old)
        if type(data) in choices:
            return data
        found = _scalar(choices[0], data)
        if found is _REFUSED:
            self._misfit(data, place, " or ".join(alternatives(members)))
        return found

    def _untagged(self, choices: list[Any], data: Any, place: Place, old: Any) -> Any:
        """Return a mapping or list without tag, which is read as the first choice."""
        before, kind = len(self.misfits), choices[0]
        found = self.value(kind, data, place, old if type(old) is kind else None)
        if len(self.misfits) > before:
            others = [f"!{choice.__name__}" for choice in choices[1:] if isinstance(choice, type)]
            first = f"!{getattr(kind, '__name__', kind)}"
            hint = f"(without a tag '{spelled(place)}' is {first}; other tags: {', '.join(others)})"
            self.misfits[before] += f" {hint}"
        return found

    def _rows(self, data: Any, place: Place) -> Any:
        """Return a vector, or a matrix as a list of equally long rows, as lists of numbers."""
        if not isinstance(data, list):
            return self._misfit(data, place, expectation(np.ndarray))
        lengths = {len(row) if isinstance(row, list) else -1 for row in data}
        if len(lengths) > 1:
            return self._misfit(data, place, "rows of equal length")
        read = self._rows if lengths - {-1} else lambda x, here: self.value(float, x, here, None)
        items = [read(item, (*place, index)) for index, item in enumerate(data)]
        return _REFUSED if any(item is _REFUSED for item in items) else items

    def _words(self, words: tuple[str, ...], values: list[Any], place: Place) -> Any:
        """Return a list of numbers in which some words may stand."""
        items = [item if item in words else _scalar(float, item) for item in values]
        for index, (item, value) in enumerate(zip(items, values, strict=True)):
            if item is _REFUSED:
                hint = did_you_mean(value, words) if isinstance(value, str) else ""
                allowed = f"a number or {' or '.join(words)}"
                self._misfit(value, (*place, index), allowed, hint)
        return _REFUSED if any(item is _REFUSED for item in items) else items

    def _unknown(self, data: dict[Any, Any], name: Any, place: Place, known: Any) -> Any:
        """Note a key that does not exist."""
        hint = decimal_comma(data, name) or did_you_mean(name, known)
        what = f"unknown key '{spelled((*place[:-1], str(name)))}' = {shown(data[name])}"
        return self._note(f"{what}: {hint}allowed: {', '.join(known) or 'no keys'}")

    def _misfit(self, value: Any, place: Place, expected: str, hint: str = "") -> Any:
        """Note a value that does not fit."""
        where = f"key '{spelled(place)}'" if place else "the root"
        return self._note(f"{where} is {shown(value)}: {hint}expected {expected}")

    def _note(self, message: str) -> Any:
        if len(self.misfits) < _MOST_MISFITS:
            self.misfits.append(message)
        return _REFUSED


def _scalar(kind: Any, value: Any) -> Any:
    """Return a YAML value as a scalar of a type, as Drake converts it, or _REFUSED; NaN is."""
    given = type(value)
    if kind is float:
        return float(value) if _is_number(value) else _REFUSED
    if kind is int:
        whole = given is int or (given is float and value.is_integer())
        whole = whole or (given is str and bool(_INTEGER.fullmatch(value)))
        return int(value) if whole and abs(int(value)) <= MAX_INTEGER else _REFUSED
    if kind is bool and given is str:
        return {"true": True, "false": False}.get(value, _REFUSED)
    if kind is Path and given is str:
        return Path(value)
    return value if given is kind else _REFUSED


def _is_number(item: Any) -> bool:
    """Whether something is a number, or text that is one."""
    return type(item) in (int, float, str) and is_number(item)


def _require_no_subclasses(choices: list[Any]) -> None:
    """Raises NotImplementedError at a member of a union that is a subclass of another one.

    Drake takes an instance of a subclass for one of its base: where the default is of the subclass
    a value with the tag of the base becomes one of the subclass.
    """
    kinds = [kind for kind in choices if isinstance(kind, type) and dataclasses.is_dataclass(kind)]
    for kind in kinds:
        if any(base is not kind and issubclass(kind, base) for base in kinds):
            raise NotImplementedError(f"{kind.__name__} is a subclass of what it stands beside")
