"""Typed YAML: files and data into dataclasses, with errors a person can act on.

Drake's ``yaml_load_typed`` does the loading. Its messages name neither file nor key path, so the
schema is walked first (:mod:`~pfsc_drake.yaml.schema_check`) and the loaded object is validated
after.
``pydrake`` is imported only when something is loaded.
"""

import dataclasses
import re
import types
import typing
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from pfsc_drake.errors import InputError, gathered_refusals, in_one_line
from pfsc_drake.yaml.bounds import out_of_bounds
from pfsc_drake.yaml.broadcast import (
    AUTO_OR_MANY,
    NUMBERS_OR_END,
    ONE_FOR_ALL,
    ONE_OR_MANY,
    OneForAll,
    as_lists,
    equal,
    mark_singles,
    spread,
)
from pfsc_drake.yaml.reading import TAG_KEY, dump_yaml, read_yaml
from pfsc_drake.yaml.schema_check import REQUIRED, Misfit, Place, find_misfits, spelled

__all__ = [
    "AUTO_OR_MANY",
    "NUMBERS_OR_END",
    "ONE_FOR_ALL",
    "ONE_OR_MANY",
    "REQUIRED",
    "equal",
    "load_file",
    "load_typed",
    "spread",
]

Schema = TypeVar("Schema")

_CONSEQUENCES = (ArithmeticError, ValueError, MemoryError)


def load_file(schema_class: type[Schema], path: str | Path) -> Schema:
    """Loads a YAML file into a schema of mutable dataclasses; see :func:`load_typed`.

    Raises:
        InputError: if the file cannot be read (:func:`pfsc_drake.yaml.reading.read_yaml`) or does
            not fit; one line that names the file.
    """
    return load_typed(schema_class, read_yaml(Path(path)), str(path))


def load_typed(schema_class: type[Schema], data: dict[str, Any], source: str) -> Schema:
    """Loads data into a schema of mutable dataclasses.

    Fields may be bool, int, float, str, Path, numpy array, list, ``dict[str, T]``, Optional, nested
    dataclasses and unions of dataclasses (chosen by a YAML tag, the first member without one; none
    a subclass of another).
    ``__post_init__`` runs once on the defaults and again on the loaded values, innermost first;
    there it checks what types cannot express by raising InputError.

    Args:
        schema_class: Dataclass. Every field has a default, because Drake builds a schema without
            arguments before it fills it in; a key that may not be left out is declared as
            ``field(default=..., metadata=REQUIRED)`` with a placeholder that
            ``__post_init__`` accepts.
        data: As :func:`pfsc_drake.yaml.reading.read_yaml` returns it.
        source: Name of the file, for messages.

    Returns:
        An instance of ``schema_class``.

    Raises:
        InputError: One line that names source, and of everything that is wrong key path, value and
            what is allowed. Where something does not fit the schema, the rest is checked without
            it, but for what contains it.
    """
    singles: list[Place] = []
    data = as_lists(schema_class, data, (), singles)
    misfits = find_misfits(schema_class, data)
    if misfits:
        messages = [misfit.message for misfit in misfits]
        messages += _further_refusals(schema_class, data, misfits)
        raise InputError(f"{source}: {in_one_line(messages)}")
    result = _load(schema_class, data, source)
    mark_singles(result, singles)
    refusals = _refusals(result, (), [])
    if refusals:
        raise InputError(f"{source}: {in_one_line(refusals)}")
    return result


def _load(schema_class: type[Schema], data: dict[str, Any], source: str) -> Schema:
    """Returns what Drake makes of data that fit."""
    from pydrake.common.yaml import yaml_load_typed

    try:
        return yaml_load_typed(schema=schema_class, data=dump_yaml(data))
    except NotImplementedError:  # a schema that Drake cannot load is a fault of the program
        raise
    except (RuntimeError, ValueError) as error:
        raise InputError(f"{source}: {' '.join(str(error).split())}") from None


def _further_refusals(
    schema_class: type, data: dict[str, Any], misfits: Sequence[Misfit]
) -> list[str]:
    """Returns what is wrong beside what does not fit the schema."""
    if not all(misfit.place for misfit in misfits):
        return []
    rest = data
    for misfit in misfits:
        rest = _without(rest, misfit.place)
    try:
        result: Any = _load(schema_class, rest, "")
    except (InputError, TypeError):  # e.g. there is no default for a key that is missing
        return []
    return _refusals(result, (), [misfit.place[:-1] for misfit in misfits])


def _without(data: dict[str, Any], place: Place) -> dict[str, Any]:
    """Returns data without one key, or of a list in it without the key that the list is under."""
    key, *way = place
    if key not in data:
        return data
    item, rest = data[key], {name: value for name, value in data.items() if name != key}
    return {**rest, key: _without(item, tuple(way))} if way and isinstance(item, dict) else rest


def _refusals(value: Any, place: Place, spoiled: Sequence[Place]) -> list[str]:
    """Runs ``__post_init__`` of every dataclass in the loaded object, innermost first.

    Args:
        value: The loaded object, or a part of it.
        place: Where it is.
        spoiled: Places of what is not whole; what contains these, or something that is refused, is
            not judged.

    Returns:
        What is refused, one message each.
    """
    found: list[str] = []
    if isinstance(value, (dict, list)):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for name, item in items:
            found += _refusals(item, (*place, name), spoiled)
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            found += _refusals(getattr(value, field.name), (*place, field.name), spoiled)
        whole = not any(other[: len(place)] == place for other in spoiled)
        if whole and not found:
            found = _own_refusals(value, place)
    return found


def _own_refusals(value: Any, place: Place) -> list[str]:
    """Returns what is refused of a dataclass without those in it, one message each."""
    beyond = {
        name: f"key '{spelled((*place, name))}' is {number:g}: expected {bounds}"
        for name, number, bounds in out_of_bounds(value)
    }
    found, post_init = list[str](), getattr(value, "__post_init__", None)
    if post_init is not None:
        where = f"key '{spelled(place)}': " if place else ""
        # what comes of numbers out of bounds says nothing, unless it is about them
        with suppress(*_CONSEQUENCES if beyond else ()), np.errstate(all="ignore"):
            with gathered_refusals() as refusals:
                post_init()
            found = [f"{where}{' '.join(refusal.split())}" for refusal in refusals]
    said = " ".join(found)
    named = all(re.search(rf"\b{re.escape(name.partition('[')[0])}\b", said) for name in beyond)
    return found if named else list(beyond.values())


def dump_typed(value: Any) -> str:
    """Returns a dataclass as YAML text; :func:`pfsc_drake.yaml.typed.load_typed` undoes it."""
    return dump_yaml(typed_data(value))


def typed_data(value: Any) -> dict[str, Any]:
    """Returns a dataclass as plain data, as :func:`pfsc_drake.yaml.reading.read_yaml` gives it.

    Every key is there; a mapping that is a later member of a union has its tag.

    Args:
        value: Instance of a dataclass whose fields have the types that
            :func:`pfsc_drake.yaml.typed.load_typed` names.

    Raises:
        TypeError: If a value is of none of the types that its field allows.
    """
    hints = typing.get_type_hints(type(value))
    return {
        field.name: _plain(getattr(value, field.name), hints[field.name])
        for field in dataclasses.fields(value)
    }


def _plain(value: Any, schema: Any) -> Any:
    """Returns a value of a field as scalars, lists and mappings."""
    origin, arguments = typing.get_origin(schema), typing.get_args(schema)
    if origin in (typing.Union, types.UnionType):
        return _member(value, arguments)
    if isinstance(value, OneForAll):
        return value[0]
    if origin is list:
        return [_plain(item, arguments[0]) for item in value]
    if origin is dict:
        return {key: _plain(item, arguments[1]) for key, item in value.items()}
    if dataclasses.is_dataclass(schema):
        if type(value) is not schema:
            raise TypeError(f"{type(value).__name__} where {schema} is declared")
        return typed_data(value)
    if schema is np.ndarray:
        return np.asarray(value, dtype=float).tolist()
    return str(value) if schema is Path else schema(value)


def _member(value: Any, members: tuple[Any, ...]) -> Any:
    """Returns a value of a union, with a tag unless it is of its first member or null."""
    if value is None and type(None) in members:
        return None
    choices = [member for member in members if member is not type(None)]
    if len(choices) == 1:
        return _plain(value, choices[0])
    if type(value) is int and float in choices and int not in choices:
        return float(value)
    if type(value) not in choices:
        raise TypeError(f"{type(value).__name__} is none of {members}")
    plain = _plain(value, type(value))
    if dataclasses.is_dataclass(value) and type(value) is not choices[0]:
        plain[TAG_KEY] = f"!{type(value).__name__}"
    return plain
