"""YAML text and plain data of dataclasses, in the form that the reader loads again."""

import dataclasses
import types
import typing
from pathlib import Path
from typing import Any

import numpy as np

from pfsc_drake.yaml.fields import OneForAll, fields_of
from pfsc_drake.yaml.reading import TAG_KEY, dump_yaml


def dump_typed(value: Any) -> str:
    """Returns a dataclass as YAML text, which :func:`~pfsc_drake.yaml.typed.load_typed` loads."""
    return dump_yaml(typed_data(value))


def typed_data(value: Any) -> dict[str, Any]:
    """Returns a dataclass as plain data, as :func:`pfsc_drake.yaml.reading.read_yaml` returns it.

    Every key is present; a mapping of a later member of a union has its tag.

    Args:
        value: Instance of a dataclass whose fields have the types that
            :func:`pfsc_drake.yaml.typed.load_typed` supports.

    Raises:
        TypeError: If a value has none of the types that its field allows.
    """
    hints = typing.get_type_hints(type(value))
    return {
        field.name: _plain(getattr(value, field.name), hints[field.name])
        for field in dataclasses.fields(value)
    }


def _plain(value: Any, schema: Any) -> Any:
    """Returns a field's value as scalars, lists and mappings."""
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
    """Returns a value of a union, with a tag unless it belongs to the first member or is null."""
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


def changed_data(value: Any, base: Any = None) -> dict[str, Any]:
    """Returns the keys of a dataclass that differ from the defaults, as plain data.

    Mandatory keys are always present. :func:`pfsc_drake.yaml.typed.load_typed` loads the data as
    the same dataclass.

    Args:
        value: As in :func:`typed_data`.
        base: Instance whose values apply to missing keys; None for the defaults of the class.
    """
    changed, owner = {}, typing.cast(Any, type(value))
    for name, field in fields_of(owner).items():
        own = getattr(value, name)
        old = getattr(base, name) if base is not None else field.default and field.default()
        whole, has_old = _plain(own, field.kind), base is not None or field.default is not None
        if field.required or not has_old or whole != _plain(old, field.kind):
            changed[name] = _changed(own, whole, old)
    return changed


def _changed(value: Any, whole: Any, old: Any) -> Any:
    """Returns the changed part of a field's plain value ``whole``."""
    if dataclasses.is_dataclass(value):
        part = changed_data(value, old if type(old) is type(value) else None)
        return part | {TAG_KEY: whole[TAG_KEY]} if TAG_KEY in whole else part
    if isinstance(value, list) and isinstance(whole, list):
        return [_changed(item, plain, None) for item, plain in zip(value, whole, strict=True)]
    if isinstance(value, dict) and set(old or ()) <= set(value):
        before = old or {}
        parts = {key: _changed(value[key], whole[key], before.get(key)) for key in value}
        return {key: part for key, part in parts.items() if part != {} or key not in before}
    return whole
