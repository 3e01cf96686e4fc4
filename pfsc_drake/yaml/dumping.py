"""Dataclasses as YAML text and plain data, which the reader undoes."""

import dataclasses
import types
import typing
from pathlib import Path
from typing import Any

import numpy as np

from pfsc_drake.yaml.fields import OneForAll
from pfsc_drake.yaml.reading import TAG_KEY, dump_yaml


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
