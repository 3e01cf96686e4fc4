"""Where the shipped robot models are, and how YAML files become typed parameters."""

import typing
from collections.abc import Iterator
from dataclasses import field, fields, is_dataclass, make_dataclass
from pathlib import Path
from types import UnionType
from typing import Any, TypeVar, Union

import numpy as np
import yaml
from pydrake.common.yaml import yaml_dump, yaml_load, yaml_load_typed
from pydrake.multibody.parsing import PackageMap

from pfsc_drake.errors import InputError

PACKAGE_NAME = "pfsc_models"
_PACKAGE_URI = f"package://{PACKAGE_NAME}/"
_LONGEST_SHOWN_VALUE = 60
_SCHEMA_ERRORS = (AssertionError, AttributeError, KeyError, RuntimeError, TypeError, ValueError)

Schema = TypeVar("Schema")


def models_directory() -> Path:
    """Returns the directory of the shipped models, which holds the Drake package ``pfsc_models``.

    A wheel carries the models inside the package; a clone, and so an editable installation, has
    them next to it.

    Raises:
        InputError: if the models are in neither place.
    """
    package = Path(__file__).resolve().parents[1]
    for directory in (package / "models", package.parent / "models"):
        if (directory / "package.xml").is_file():
            return directory
    raise InputError(f"robot models of {package.name}: not found in the package nor next to it")


def add_models_to(package_map: PackageMap) -> None:
    """Makes ``package://pfsc_models/...`` known to a parser; does nothing if it is already.

    Args:
        package_map: of the ``Parser`` that is to read the models (``parser.package_map()``).
    """
    if not package_map.Contains(PACKAGE_NAME):
        package_map.Add(PACKAGE_NAME, models_directory())


def resolve_model(name_or_path: str | Path) -> Path:
    """Returns the file of a robot model.

    Args:
        name_or_path: the name of a shipped model (``"comau_racer_1_4_elastic"``), an address
            ``"package://pfsc_models/..."``, or the path of a model file of the user's own.

    Raises:
        InputError: if there is no such file.
    """
    text = str(name_or_path)
    directory = models_directory()
    if text.startswith(_PACKAGE_URI):
        path = directory / text.removeprefix(_PACKAGE_URI)
    elif Path(text).suffix:
        path = Path(text)
    else:
        shipped = {file.stem: file for file in sorted(directory.glob("*/*.sdf"))}
        if text not in shipped:
            raise InputError(f"robot model {text!r}: must be a file or one of {', '.join(shipped)}")
        path = shipped[text]
    if not path.is_file():
        raise InputError(f"robot model {text!r}: no such file")
    return path


def load_yaml(schema: type[Schema], path: Path) -> Schema:
    """Reads a YAML file into a dataclass, as ``yaml_load_typed`` does.

    Args:
        schema: a mutable dataclass in which every field has a default.
        path: of the YAML file.

    Raises:
        InputError: one line naming the file and, unless the file as a whole is at fault, the key.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not UTF-8 text") from error
    try:
        node = yaml_load(data=text)
    except yaml.YAMLError as error:
        raise InputError(f"{path}: is not valid YAML: {' '.join(str(error).split())}") from error
    if not isinstance(node, dict):
        raise InputError(f"{path}: holds {type(node).__name__}: must hold keys with values")
    try:
        return yaml_load_typed(schema=schema, data=text)
    except _SCHEMA_ERRORS as error:
        raise InputError(f"{path}: {_describe_fault(schema, node)}") from error


def _describe_fault(schema: Any, node: Any, key: str = "") -> str:
    """Returns what is wrong with a node that a schema refuses, at the innermost key at fault."""
    for inner_schema, inner, inner_key in _children(schema, node, key):
        if inner_schema is None:
            allowed = ", ".join(entry.name for entry in fields(schema))
            return f"{inner_key}: unknown key: must be one of {allowed}"
        if not _accepts(inner_schema, inner):
            return _describe_fault(inner_schema, inner, inner_key)
    shown = repr(node)
    if len(shown) > _LONGEST_SHOWN_VALUE:
        shown = shown[:_LONGEST_SHOWN_VALUE] + "..."
    expected = schema.__name__ if isinstance(schema, type) else str(schema)
    return f"{key} = {shown}: must be of type {expected}"


def _children(schema: Any, node: Any, key: str) -> Iterator[tuple[Any, Any, str]]:
    """Yields schema, node and key of everything inside a node; schema None for unknown keys."""
    item_schema = (typing.get_args(schema) or (None,))[-1]
    if is_dataclass(schema) and isinstance(node, dict):
        hints = typing.get_type_hints(schema)
        for name, value in node.items():
            yield hints.get(name), value, f"{key}.{name}" if key else str(name)
    elif typing.get_origin(schema) is list and isinstance(node, list):
        for index, value in enumerate(node):
            yield item_schema, value, f"{key}[{index}]"
    elif typing.get_origin(schema) is dict and isinstance(node, dict):
        for name, value in node.items():
            yield item_schema, value, f"{key}.{name}"


def _accepts(schema: Any, node: Any) -> bool:
    kind = typing.get_origin(schema) or schema
    default = {np.ndarray: lambda: np.zeros(0), Union: lambda: None, UnionType: lambda: None}
    value = field(default_factory=default.get(kind, kind))
    holder = make_dataclass("Holder", [("value", schema, value)])
    try:
        yaml_load_typed(schema=holder, data=yaml_dump({"value": node}))
    except _SCHEMA_ERRORS:
        return False
    return True
