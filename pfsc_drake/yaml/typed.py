"""Typed YAML: files and data into dataclasses, with errors a person can act on.

Drake's ``yaml_load_typed`` does the loading. Its messages name neither file nor key path, so the
schema is walked first (:mod:`~pfsc_drake.yaml.schema_check`) and the loaded object is validated
after.
``pydrake`` is imported only when something is loaded.
"""

import dataclasses
import types
import typing
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.yaml.reading import TAG_KEY, dump_yaml, read_yaml
from pfsc_drake.yaml.schema_check import REQUIRED, check_schema

__all__ = ["AUTO_OR_MANY", "ONE_OR_MANY", "REQUIRED", "load_file", "load_typed"]

ONE_OR_MANY = {"one_or_many": True}  # metadata of a list whose only item may be given without list
AUTO_OR_MANY = {"empty_word": "auto"}  # metadata of a list for which ``auto`` says that it is empty

Schema = TypeVar("Schema")


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
        InputError: One line that names source, key path, value and what is allowed.
    """
    from pydrake.common.yaml import yaml_load_typed

    data = _listed(schema_class, data)
    check_schema(schema_class, data, source)
    try:
        result = yaml_load_typed(schema=schema_class, data=dump_yaml(data))
    except NotImplementedError:  # a schema that Drake cannot load is a fault of the program
        raise
    except (RuntimeError, ValueError) as error:
        raise InputError(f"{source}: {' '.join(str(error).split())}") from None
    _validate(result, source, "")
    return result


def _listed(schema: Any, data: Any) -> Any:
    """Returns data with lists wherever the schema allows a single item or a word for a list."""
    if not isinstance(data, dict):
        return data
    if typing.get_origin(schema) is dict:
        kind = typing.get_args(schema)[1]
        return {key: _listed(kind, item) for key, item in data.items()}
    if not dataclasses.is_dataclass(schema):
        return data
    hints, listed = typing.get_type_hints(schema), dict(data)
    for field in dataclasses.fields(schema):
        if field.name in data:
            item = data[field.name]
            if item == field.metadata.get("empty_word", ...):
                listed[field.name] = []
                continue
            single = field.metadata.get("one_or_many") and isinstance(item, (int, float, str))
            listed[field.name] = [item] if single else _listed(hints[field.name], item)
    return listed


def _validate(value: Any, source: str, key: str) -> None:
    """Runs ``__post_init__`` of every dataclass in the loaded object, innermost first."""
    if isinstance(value, dict):
        for name, item in value.items():
            _validate(item, source, f"{key}.{name}")
    elif isinstance(value, list):
        for index, item in enumerate(value):
            _validate(item, source, f"{key}[{index}]")
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            prefix = f"{key}." if key else ""
            _validate(getattr(value, field.name), source, prefix + field.name)
        post_init = getattr(value, "__post_init__", None)
        if post_init is not None:
            try:
                post_init()
            except InputError as error:
                where = f"key {key!r}: " if key else ""
                raise InputError(f"{source}: {where}{' '.join(str(error).split())}") from None


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
    if type(value) not in choices:
        raise TypeError(f"{type(value).__name__} is none of {members}")
    plain = _plain(value, type(value))
    if dataclasses.is_dataclass(value) and type(value) is not choices[0]:
        plain[TAG_KEY] = f"!{type(value).__name__}"
    return plain
