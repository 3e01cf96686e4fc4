"""Typed YAML: files and data as dataclasses, with messages that name file, line and key.

The format is Drake's ``yaml_load_typed``, whose messages name neither file nor key. A missing key
has its default, also in nested blocks; a tag chooses a member of a union; text that reads as a
number is one. In addition, a single number or a word may stand for a list
(:mod:`pfsc_drake.yaml.fields`), and NaN is refused.
"""

import collections.abc
import dataclasses
import re
import types
import typing
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from pfsc_drake.checks import is_number
from pfsc_drake.errors import did_you_mean, gathered_refusals
from pfsc_drake.yaml.fields import Field, OneForAll, fields_of, former_names
from pfsc_drake.yaml.misfits import (
    MAX_INTEGER,
    SCALARS,
    alternatives,
    decimal_comma,
    expectation,
    range_of_type,
    value_text,
)
from pfsc_drake.yaml.reading import TAG_KEY, read_with_lines
from pfsc_drake.yaml.rules import check_value
from pfsc_drake.yaml.source import KeyPath, Source, join_keys

Schema = TypeVar("Schema")

_MOST_MISFITS = 50  # of one file
_INTEGER = re.compile(r"[-+]?[0-9]{1,19}")
# in calculations with numbers that are out of bounds
_CONSEQUENCES = (ArithmeticError, ValueError, MemoryError)
# in place of a refused value
_REFUSED: Any = object()


def load_file(schema_class: type[Schema], path: str | Path) -> Schema:
    """Loads a YAML file into a schema of dataclasses; see :func:`load_typed`.

    Raises:
        InputError: If the file cannot be read (:func:`pfsc_drake.yaml.reading.read_yaml`) or does
            not fit; one line that names the file and the line of the key.
    """
    data, lines = read_with_lines(Path(path))
    return load_typed(schema_class, data, Source(str(path), {**lines}))


def load_typed(schema_class: type[Schema], data: dict[str, Any], source: str | Source) -> Schema:
    """Loads data into a schema of dataclasses.

    Fields may be bool, int, float, str, Path, numpy array, list, ``dict[str, T]``, Optional, nested
    dataclasses and unions of dataclasses (chosen by a YAML tag, the first member without one; none
    a subclass of another). A dataclass is created, innermost first, after all values in it fit; its
    ``__post_init__`` checks it and raises InputError.

    Args:
        schema_class: Dataclass. A mandatory key has no default, or is declared as
            ``field(default=..., metadata=REQUIRED)``.
        data: As returned by :func:`pfsc_drake.yaml.reading.read_yaml`; it is not changed.
        source: File, or its name, for messages.

    Returns:
        An instance of ``schema_class``.

    Raises:
        InputError: One line with the name of the source and, for every wrong key, its line if it
            is known, its path, its value and the allowed values. A dataclass with a wrong value is
            not checked as a whole, but its other fields are.
    """
    reader = _Reader()
    result = reader.block(schema_class, data, (), None)
    problems = reader.misfits + reader.refusals
    if problems:
        raise (Source(source) if isinstance(source, str) else source).refusal(problems)
    for message in reader.renamed:
        name = source if isinstance(source, str) else source.name
        warnings.warn(f"{name}: {message}", FutureWarning, stacklevel=2)
    return result


@contextmanager
def collected_renames() -> Iterator[list[str]]:
    """Collect the warnings about former names of keys, instead of showing them."""
    messages: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", FutureWarning)
        yield messages
    messages += [str(one.message) for one in caught if one.category is FutureWarning]


class _Reader:
    """Reader of one file along its schema; a refused value becomes _REFUSED.

    Attributes:
        misfits: Messages about values that do not fit the schema, in the order of the file.
        refusals: Messages about values that fit and are refused.
        renamed: Messages about former names of keys.
    """

    def __init__(self) -> None:
        self.misfits: list[str] = []
        self.refusals: list[str] = []
        self.renamed: list[str] = []

    def block(self, schema: Any, data: Any, key_path: KeyPath, base: Any) -> Any:
        """Return a dataclass.

        Args:
            schema: Its class.
            data: Mapping of its keys.
            key_path: Its key path.
            base: Instance whose values apply to missing keys; None for the defaults.
        """
        fields = fields_of(schema)
        if not isinstance(data, dict):
            return self._misfit(data, key_path, expectation(schema))
        if TAG_KEY in data:
            return self._misfit(data[TAG_KEY], key_path, "a mapping without a tag")
        values, former = {}, former_names(schema)
        for name, item in data.items():
            here, present = (*key_path, name), former.get(name, name)
            if present in fields and (present == name or present not in data):
                values[present] = self._field(fields[present], item, here, base)
            else:
                values[name] = self._unknown(data, name, here, fields)
            if present != name:
                self.renamed.append(
                    f"{join_keys(here)} is now called '{present}'; the former name is read in this "
                    "version only"
                )
        for name, field in fields.items():
            if name not in values and field.required:
                here = (*key_path, name)
                values[name] = self._note(
                    f"missing key '{join_keys(here)}': expected {expectation(field.kind)}"
                )
        return self._instance(schema, values, key_path, base)

    def _instance(self, schema: Any, values: dict[str, Any], key_path: KeyPath, base: Any) -> Any:
        """Return a dataclass of values, or note which of them are refused."""
        fields, result = fields_of(schema), _REFUSED
        good = {name: value for name, value in values.items() if value is not _REFUSED}
        beyond = {
            name: f"key '{join_keys((*key_path, name))}' is {number:g}: "
            f"expected a number from {bounds}"
            for key, value in good.items()
            for bounds in [fields[key].bounds]
            for name, number in fields[key].out_of_bounds(value)
        }
        # errors that follow from numbers out of bounds are ignored, unless they name these
        ignored = _CONSEQUENCES if beyond else ()
        with suppress(*ignored), np.errstate(all="ignore"), gathered_refusals() as messages:
            if len(good) < len(values):
                for name, value in good.items():
                    check_value(fields[name].hint, name, value)
            else:
                result = schema(**good) if base is None else dataclasses.replace(base, **good)
        text = " ".join(messages)
        named = all(re.search(rf"\b{re.escape(key.partition('[')[0])}\b", text) for key in beyond)
        found = (
            [_of_block(key_path, one, fields) for one in messages] if named else [*beyond.values()]
        )
        self.refusals += found
        return _REFUSED if found else result

    def _field(self, field: Field, item: Any, key_path: KeyPath, base: Any) -> Any:
        """Return the value of a field, also from a number or word in place of its list."""
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
            return self._words(form["words"], item, key_path)
        if field.takes_a_number and not isinstance(item, list):
            word = form.get("empty_word")
            single = f"a number, {word}" if word else "a number"
            return self._misfit(item, key_path, f"{single} or {expectation(field.kind)}")
        # missing keys keep their values in a block or a mapping
        old = None
        if isinstance(item, dict):
            old = (
                getattr(base, field.name) if base is not None else field.default and field.default()
            )
        return self.value(field.kind, item, key_path, old)

    def value(self, kind: Any, data: Any, key_path: KeyPath, old: Any) -> Any:
        """Return a value of a type.

        Args:
            kind: The type.
            data: The data from the file.
            key_path: Its key path.
            old: Value that it changes, if it is a mapping; None for none.
        """
        origin, arguments = typing.get_origin(kind), typing.get_args(kind)
        if dataclasses.is_dataclass(kind):
            return self.block(kind, data, key_path, old)
        if kind in SCALARS:
            found = _scalar(kind, data)
            if found is _REFUSED:
                self._misfit(data, key_path, expectation(kind) + range_of_type(kind, data))
            return found
        if origin in (typing.Union, types.UnionType):
            return self._union(arguments, data, key_path, old)
        if kind is np.ndarray:
            rows = self._rows(data, key_path)
            return rows if rows is _REFUSED else np.array(rows, dtype=float)
        if origin is list:
            if not isinstance(data, list):
                return self._misfit(data, key_path, expectation(kind))
            items = [self.value(arguments[0], x, (*key_path, i), None) for i, x in enumerate(data)]
            return _REFUSED if any(item is _REFUSED for item in items) else items
        if origin in (dict, collections.abc.Mapping):
            return self._mapping(kind, data, key_path, old or {})
        raise NotImplementedError(f"{kind} is no type of a schema")

    def _mapping(self, kind: Any, data: Any, key_path: KeyPath, old: dict[str, Any]) -> Any:
        """Return a mapping of names; entries missing in the data stay as before."""
        if not isinstance(data, dict):
            return self._misfit(data, key_path, expectation(kind))
        found, item_kind = dict(old), typing.get_args(kind)[1]
        for name, item in data.items():
            if isinstance(name, str):
                found[name] = self.value(item_kind, item, (*key_path, name), old.get(name))
            else:
                what = f"key '{join_keys((*key_path, str(name)))}' is {value_text(name)}"
                found[name] = self._note(f"{what}: expected a key that is text")
        return _REFUSED if any(item is _REFUSED for item in found.values()) else found

    def _union(self, members: tuple[Any, ...], data: Any, key_path: KeyPath, old: Any) -> Any:
        """Return an optional value, one of several scalars, or a dataclass by its tag."""
        choices = [member for member in members if member is not types.NoneType]
        _require_no_subclasses(choices)
        if data is None and len(choices) < len(members):
            return None
        if len(choices) == 1 and data is not None:
            return self.value(choices[0], data, key_path, old)
        if isinstance(data, dict) and TAG_KEY in data:
            by_tag = {f"!{getattr(choice, '__name__', choice)}": choice for choice in choices}
            tag = str(data[TAG_KEY])
            if tag not in by_tag:
                hint = f"{did_you_mean(tag, by_tag)}allowed: {', '.join(by_tag)}"
                return self._note(f"key '{join_keys(key_path)}': unknown tag {tag}: {hint}")
            kind = by_tag[tag]
            content = {name: item for name, item in data.items() if name != TAG_KEY}
            return self.value(kind, content, key_path, old if type(old) is kind else None)
        if isinstance(data, (dict, list)):
            return self._untagged(choices, data, key_path, old)
        if type(data) in choices:
            return data
        found = _scalar(choices[0], data)
        if found is _REFUSED:
            self._misfit(data, key_path, " or ".join(alternatives(members)))
        return found

    def _untagged(self, choices: list[Any], data: Any, key_path: KeyPath, old: Any) -> Any:
        """Return a mapping or list without tag, which is read as the first member."""
        before, kind = len(self.misfits), choices[0]
        found = self.value(kind, data, key_path, old if type(old) is kind else None)
        if len(self.misfits) > before:
            others = [f"!{choice.__name__}" for choice in choices[1:] if isinstance(choice, type)]
            first = f"!{getattr(kind, '__name__', kind)}"
            untagged = f"without a tag '{join_keys(key_path)}' is {first}"
            self.misfits[before] += f" ({untagged}; other tags: {', '.join(others)})"
        return found

    def _rows(self, data: Any, key_path: KeyPath) -> Any:
        """Return a vector, or a matrix as a list of equally long rows, as lists of numbers."""
        if not isinstance(data, list):
            return self._misfit(data, key_path, expectation(np.ndarray))
        lengths = {len(row) if isinstance(row, list) else -1 for row in data}
        if len(lengths) > 1:
            return self._misfit(data, key_path, "rows of equal length")
        read = self._rows if lengths - {-1} else lambda x, here: self.value(float, x, here, None)
        items = [read(item, (*key_path, index)) for index, item in enumerate(data)]
        return _REFUSED if any(item is _REFUSED for item in items) else items

    def _words(self, words: tuple[str, ...], values: list[Any], key_path: KeyPath) -> Any:
        """Return a list of numbers in which some words are allowed."""
        items = [item if item in words else _scalar(float, item) for item in values]
        for index, (item, value) in enumerate(zip(items, values, strict=True)):
            if item is _REFUSED:
                hint = did_you_mean(value, words) if isinstance(value, str) else ""
                allowed = f"a number or {' or '.join(words)}"
                self._misfit(value, (*key_path, index), allowed, hint)
        return _REFUSED if any(item is _REFUSED for item in items) else items

    def _unknown(self, data: dict[Any, Any], name: Any, key_path: KeyPath, known: Any) -> Any:
        """Note a key that does not exist."""
        hint = decimal_comma(data, name) or did_you_mean(name, known)
        what = f"unknown key '{join_keys((*key_path[:-1], str(name)))}' = {value_text(data[name])}"
        return self._note(f"{what}: {hint}allowed: {', '.join(known) or 'no keys'}")

    def _misfit(self, value: Any, key_path: KeyPath, expected: str, hint: str = "") -> Any:
        """Note a value that does not fit."""
        where = f"key '{join_keys(key_path)}'" if key_path else "the root"
        return self._note(f"{where} is {value_text(value)}: {hint}expected {expected}")

    def _note(self, message: str) -> Any:
        if len(self.misfits) < _MOST_MISFITS:
            self.misfits.append(message)
        return _REFUSED


def _of_block(key_path: KeyPath, message: str, fields: typing.Mapping[str, Field]) -> str:
    """Return the message of a dataclass, in one line, with its key path in front."""
    text = " ".join(message.split())
    if not key_path:
        return text
    word = re.match(r"\w*", text)
    begins_with_key = word is not None and word[0] in fields
    return f"{join_keys(key_path)}{'.' if begins_with_key else ': '}{text}"


def _scalar(kind: Any, value: Any) -> Any:
    """Return a YAML value as a scalar of a type, as Drake does, or _REFUSED, also for NaN."""
    data_type = type(value)
    if kind is float:
        return float(value) if _is_number(value) else _REFUSED
    if kind is int:
        whole = data_type is int or (data_type is float and value.is_integer())
        whole = whole or (data_type is str and bool(_INTEGER.fullmatch(value)))
        return int(value) if whole and abs(int(value)) <= MAX_INTEGER else _REFUSED
    if kind is bool and data_type is str:
        return {"true": True, "false": False}.get(value, _REFUSED)
    if kind is Path and data_type is str:
        return Path(value)
    return value if data_type is kind else _REFUSED


def _is_number(item: Any) -> bool:
    """Whether something is a number, or text that is one."""
    return type(item) in (int, float, str) and is_number(item)


def _require_no_subclasses(choices: list[Any]) -> None:
    """Raises NotImplementedError at a member of a union that is a subclass of another one.

    Drake accepts an instance of a subclass for its base: with a default of the subclass, a value
    with the tag of the base would become one of the subclass.
    """
    kinds = [kind for kind in choices if isinstance(kind, type) and dataclasses.is_dataclass(kind)]
    for kind in kinds:
        if any(base is not kind and issubclass(kind, base) for base in kinds):
            raise NotImplementedError(f"{kind.__name__} is a subclass of what it stands beside")
