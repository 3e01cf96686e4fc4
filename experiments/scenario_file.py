"""Scenario files: listing, finding, reading, and overrides by ``--set``.

Nothing here imports Drake, so that listing scenarios is fast.
"""

import hashlib
import json
import os
import stat
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pfsc_drake.errors import InputError, did_you_mean, nearest_file, shorten
from pfsc_drake.yaml.reading import (
    MAX_DEPTH,
    find_status,
    parse_yaml,
    read_with_lines,
    read_yaml,
)
from pfsc_drake.yaml.source import KeyPath, Locations, Source, join_keys, override_location

SCENARIO_DIRECTORY = Path(__file__).resolve().parent / "scenarios"
_MAX_PATH = 4096  # characters


@dataclass
class CatalogEntry:
    """A shipped scenario as listed.

    Attributes:
        name: Name to run it by: the file's name without suffix.
        section: Section of the dissertation, e.g. ``"3.8.3"``.
        description: One line.
    """

    name: str
    section: str
    description: str


def scenario_names(directory: Path = SCENARIO_DIRECTORY) -> list[str]:
    """Return the names of the scenarios in a folder, sorted."""
    return sorted(path.stem for path in directory.glob("*.yaml"))


def find_scenario(
    name_or_path: str, directory: Path = SCENARIO_DIRECTORY, others: Sequence[str] = ()
) -> Path:
    """Return the file of a scenario.

    Args:
        name_or_path: A shipped name, or the path of a YAML file (with a folder or a suffix).
        directory: Folder of the shipped scenarios.
        others: Further known names, for the message.

    Returns:
        Path of an existing file.

    Raises:
        InputError: If there is none; names the nearest shipped name and all others.
    """
    names = scenario_names(directory)
    if name_or_path in names:
        return directory / f"{name_or_path}.yaml"
    path = expand_home(Path(name_or_path))
    status = find_status(path)
    is_folder = status is not None and stat.S_ISDIR(status.st_mode)
    if status is not None and not is_folder:
        return path  # reading reports a pipe or a device
    if path.suffix in (".yaml", ".yml") or len(path.parts) > 1:
        reason = "is a folder" if is_folder else f"no such file{nearest_file(path)}"
        raise InputError(f"scenario file {shorten(name_or_path, 200)}: {reason}")
    hint = did_you_mean(name_or_path, [*names, *others], cutoff=0.5)
    name = shorten(repr(name_or_path))
    raise InputError(
        f"unknown scenario {name}: {hint}available: {', '.join(names) or 'none'},"
        " or the path of a YAML file"
    )


def expand_home(path: Path) -> Path:
    """Return a path with its leading ``~`` or ``~user`` replaced by the home folder.

    Raises:
        InputError: If there is no such home.
    """
    try:
        return path.expanduser()
    except RuntimeError:
        raise InputError(f"{path}: no home folder is known for {path.parts[0]}") from None


def list_scenarios(directory: Path = SCENARIO_DIRECTORY) -> list[CatalogEntry]:
    """Return the shipped scenarios with section and description, ordered by section, then name.

    Args:
        directory: Folder of the scenarios.

    Returns:
        One entry per YAML file, from its top-level keys ``section`` and ``description``.

    Raises:
        InputError: If a file cannot be read (see :func:`pfsc_drake.yaml.reading.read_yaml`).
    """
    entries = [_entry(directory / f"{name}.yaml") for name in scenario_names(directory)]
    return sorted(entries, key=lambda entry: (entry.section, entry.name))


def _entry(path: Path) -> CatalogEntry:
    """Return the catalog entry of one file."""
    data = read_yaml(path)
    description = " ".join(str(data.get("description", "")).split())
    return CatalogEntry(path.stem, str(data.get("section", "")), description)


@dataclass
class ScenarioFile:
    """A scenario as read, before it is checked against a schema.

    Attributes:
        path: The file.
        data: Its content with overrides applied; a mapping with YAML tag holds it as ``_tag``.
        locations: Lines of its keys, or the options that have set them, for messages.
    """

    path: Path
    data: dict[str, Any]
    locations: Locations = field(default_factory=dict)

    @property
    def source(self) -> Source:
        """File with the locations of keys and the names of files, for messages."""
        folder = self.path.parent
        files = {str(folder / text): join_keys(key_path) for key_path, text in _texts(self.data)}
        return Source(str(self.path), self.locations, files)

    @property
    def name(self) -> str:
        """Key ``name`` of the file, else the file's name without suffix, as text."""
        stem = os.fsencode(self.path.stem).decode("utf-8", "replace")
        name = self.data.get("name")
        return name if isinstance(name, str) else stem

    @property
    def fingerprint(self) -> str:
        """SHA-256 of the content."""
        text = json.dumps([self.name, self.data], sort_keys=True, default=str)
        return hashlib.sha256(text.encode("utf-8", "backslashreplace")).hexdigest()

    def inputs(self) -> list[Path]:
        """Return the file itself and every path that a text in it may denote."""
        folder = self.path.parent
        return [self.path, *(folder / text for _, text in _texts(self.data))]

    def override(self, text: str, option: str = "--set") -> None:
        """Set one ``key.path=value`` in place; see :func:`apply_override`."""
        key = apply_override(self.data, text, option)
        override_location(self.locations, key, f"{option} {shorten(text)}")

    def change(self, key: str, value: Any) -> None:
        """Set one key in place to a value of Python; see :func:`apply_change`."""
        changed = apply_change(self.data, key, value)
        override_location(self.locations, changed, _description(key, value))


def read_scenario(
    name_or_path: str, overrides: list[str], others: Sequence[str] = ()
) -> ScenarioFile:
    """Find and read a scenario; see :func:`find_scenario` and :func:`load_scenario_data`."""
    return _read(find_scenario(name_or_path, others=others), overrides)


def load_scenario_data(path: Path, overrides: list[str]) -> dict[str, Any]:
    """Read a scenario file and apply overrides.

    Args:
        path: YAML file with a mapping at its root. Root keys that start with ``_`` are private
            (places for anchors) and dropped.
        overrides: ``key.path=value`` each; a number in the path is a list index, the value is YAML.
            Missing mappings along the key path are created; typed loading checks that the keys
            exist.

    Returns:
        The data.

    Raises:
        InputError: If the file cannot be read (see :func:`pfsc_drake.yaml.reading.read_yaml`) or an
            override is malformed.
    """
    return _read(path, overrides).data


def _read(path: Path, overrides: list[str]) -> ScenarioFile:
    """Read a scenario file and apply overrides."""
    data, lines = read_with_lines(path)
    scenario = ScenarioFile(path, data, {**lines})
    for override in overrides:
        scenario.override(override)
    return scenario


def _texts(data: Any, key_path: KeyPath = ()) -> Iterator[tuple[KeyPath, str]]:
    """Iterate over texts in data that may be file names, with their key paths."""
    if isinstance(data, str) and len(data) <= _MAX_PATH:
        yield key_path, data
    elif isinstance(data, dict):
        for key, value in data.items():
            yield from _texts(value, (*key_path, key))
    elif isinstance(data, list):
        for index, value in enumerate(data):
            yield from _texts(value, (*key_path, index))


def apply_override(data: dict[str, Any], override: str, option: str = "--set") -> str:
    """Set one ``key.path=value`` in place, see :func:`load_scenario_data`.

    Args:
        data: Data of a scenario.
        override: The override.
        option: Option of the command line, for messages.

    Returns:
        Its key path, with list indices in brackets.

    Raises:
        InputError: If the override is malformed, or its path leads through a scalar.
    """
    source = f"{option} {shorten(override, 100)}"
    path, separator, text = override.partition("=")
    keys = _keys(path if separator else "", source)
    return _set(data, keys, parse_yaml(text, source), source)


def apply_change(data: dict[str, Any], key: str, value: Any) -> str:
    """Set one key in place to a value of Python.

    Args:
        data: Data of a scenario.
        key: ``key.path``, as in an override.
        value: Text, which is read as YAML as in an override, so that it may have a tag; or numbers,
            truth values, None, and lists, arrays and mappings of these, taken as they are.

    Returns:
        Its key path, with list indices in brackets.

    Raises:
        InputError: If the key is malformed or leads through a scalar, or the value has no YAML
            equivalent.
    """
    source = _description(key, value)
    keys = _keys(key, source)
    return _set(data, keys, _plain(value, source, len(keys)), source)


def _description(key: str, value: Any) -> str:
    """Return a change by a script, for messages."""
    return f"change {shorten(f'{key} = {value!r}', 100)}"


def _plain(value: Any, source: str, depth: int) -> Any:
    """Return a Python value as YAML data."""
    if isinstance(value, str):
        return parse_yaml(value, source)
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "tolist"):  # an array or a number of numpy
        value = value.tolist()
    if value is None or isinstance(value, (bool, int, float)):
        return value
    if depth < MAX_DEPTH and isinstance(value, (list, tuple)):
        return [_plain(item, source, depth + 1) for item in value]
    if depth < MAX_DEPTH and isinstance(value, dict):
        return {str(key): _plain(item, source, depth + 1) for key, item in value.items()}
    raise InputError(
        f"{source}: of type {type(value).__name__}; allowed: text, numbers, true or false, None, "
        f"and lists and mappings of these, up to {MAX_DEPTH} levels"
    )


def _keys(path: str, source: str) -> list[str]:
    """Return the keys of an override, starting at the root."""
    keys = path.strip().split(".")
    if not all(keys):
        raise InputError(f"{source}: malformed; allowed: key.path=value")
    if len(keys) > MAX_DEPTH:
        raise InputError(f"{source}: {len(keys)} levels; allowed: up to {MAX_DEPTH}")
    return keys


def _set(data: dict[str, Any], keys: list[str], value: Any, source: str) -> str:
    """Set a value, creating missing mappings along the key path, which is returned."""
    target: Any = data
    key_path: list[str | int] = []
    for depth, key in enumerate(keys):
        here = ".".join(keys[:depth]) or "the scenario"
        index = _index(target, key, f"{source}: {here}")
        key_path.append(index)
        if depth == len(keys) - 1:
            target[index] = value
        elif isinstance(target, dict):
            # An absent mapping may exist as a default in the schema; null counts as absent.
            if target.get(index) is None:
                target[index] = {}
            target = target[index]
        else:
            target = target[index]
    return join_keys(tuple(key_path))


def _index(target: Any, key: str, here: str) -> str | int:
    """Return the key or list index of one step of an override."""
    if isinstance(target, dict):
        return key
    if not isinstance(target, list):
        raise InputError(f"{here} is {shorten(repr(target))} and has no key {key!r}")
    if not key.isdecimal() or int(key) >= len(target):
        allowed = f"0 to {len(target) - 1}" if target else "none, it is empty"
        raise InputError(f"{here} is a list, {key!r} is no index of it; allowed: {allowed}")
    return int(key)
