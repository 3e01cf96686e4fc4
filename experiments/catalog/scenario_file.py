"""Reading a scenario file: YAML with typed mappings, and ``--set`` overrides on top."""

import hashlib
import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.catalog.scenario_catalog import find_scenario
from pfsc_drake.errors import InputError, shortened
from pfsc_drake.yaml.reading import MAX_DEPTH, parse_yaml, read_yaml

_MAX_PATH = 4096  # characters

__all__ = [
    "ScenarioFile",
    "apply_override",
    "find_scenario",
    "load_scenario_data",
    "read_scenario",
]


@dataclass
class ScenarioFile:
    """A scenario as read, before it is checked against a schema.

    Attributes:
        path: The file.
        data: Its content with overrides applied; a mapping with YAML tag holds it as ``_tag``.
    """

    path: Path
    data: dict[str, Any]

    @property
    def name(self) -> str:
        """Key ``name`` of the file, else the file's name without suffix, as text."""
        stem = os.fsencode(self.path.stem).decode("utf-8", "replace")
        return str(self.data.get("name", stem))

    @property
    def fingerprint(self) -> str:
        """SHA-256 of the content."""
        text = json.dumps([self.name, self.data], sort_keys=True, default=str)
        return hashlib.sha256(text.encode("utf-8", "backslashreplace")).hexdigest()

    def inputs(self) -> list[Path]:
        """Returns the file itself and every path that a text in it may stand for."""
        folder = self.path.parent
        return [self.path, *(folder / text for text in _texts(self.data))]


def read_scenario(name_or_path: str, overrides: list[str]) -> ScenarioFile:
    """Finds and reads a scenario; see :func:`find_scenario` and :func:`load_scenario_data`."""
    path = find_scenario(name_or_path)
    return ScenarioFile(path, load_scenario_data(path, overrides))


def load_scenario_data(path: Path, overrides: list[str]) -> dict[str, Any]:
    """Reads a scenario file and applies overrides.

    Args:
        path: YAML file with a mapping at its root. Root keys that start with ``_`` are private
            (places for anchors) and dropped.
        overrides: ``key.path=value`` each; a number in the path is a list index, the value is
            YAML. A mapping that is missing on the way is created; whether the keys exist is
            found out by typed loading.

    Returns:
        The data.

    Raises:
        InputError: If the file cannot be read (see :func:`pfsc_drake.yaml.reading.read_yaml`) or an
            override is malformed.
    """
    data = read_yaml(path)
    for override in overrides:
        apply_override(data, override)
    return data


def _texts(data: Any) -> Iterator[str]:
    """All texts in data that a name of a file could be."""
    if isinstance(data, str) and len(data) <= _MAX_PATH:
        yield data
    elif isinstance(data, dict):
        for value in data.values():
            yield from _texts(value)
    elif isinstance(data, list):
        for value in data:
            yield from _texts(value)


def apply_override(data: dict[str, Any], override: str, option: str = "--set") -> None:
    """Sets one ``key.path=value`` in place, see :func:`load_scenario_data`.

    Args:
        data: Of a scenario.
        override: What to set.
        option: Of the command line, for messages.

    Raises:
        InputError: If the override is malformed, or goes through what is no mapping or list.
    """
    source = f"{option} {shortened(override, 100)}"
    path, separator, text = override.partition("=")
    keys = path.strip().split(".")
    if not separator or not all(keys):
        raise InputError(f"{source}: malformed; allowed: key.path=value")
    if len(keys) > MAX_DEPTH:
        raise InputError(f"{source}: {len(keys)} levels; allowed: up to {MAX_DEPTH}")
    value = parse_yaml(text, source)
    target: Any = data
    for depth, key in enumerate(keys):
        here = ".".join(keys[:depth]) or "the scenario"
        place = _place(target, key, f"{source}: {here}")
        if depth == len(keys) - 1:
            target[place] = value
        elif isinstance(target, dict):
            # An absent mapping may exist as a default in the schema; null counts as absent.
            if target.get(place) is None:
                target[place] = {}
            target = target[place]
        else:
            target = target[place]


def _place(target: Any, key: str, here: str) -> str | int:
    """Key or list index of one step of an override."""
    if isinstance(target, dict):
        return key
    if not isinstance(target, list):
        raise InputError(f"{here} is {shortened(repr(target))} and has no key {key!r}")
    if not key.isdecimal() or int(key) >= len(target):
        allowed = f"0 to {len(target) - 1}" if target else "none, it is empty"
        raise InputError(f"{here} is a list, {key!r} is no index of it; allowed: {allowed}")
    return int(key)
