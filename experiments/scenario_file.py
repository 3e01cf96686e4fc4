"""Scenario files: finding and listing the shipped ones, reading any, ``--set`` on top.

Nothing here imports Drake, so that a list is there at once.
"""

import hashlib
import json
import os
import stat
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pfsc_drake.errors import InputError, did_you_mean, nearest_file, shortened
from pfsc_drake.yaml.reading import MAX_DEPTH, find_status, parse_yaml, read_yaml

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
    """Names of the scenarios in a folder, sorted."""
    return sorted(path.stem for path in directory.glob("*.yaml"))


def find_scenario(
    name_or_path: str, directory: Path = SCENARIO_DIRECTORY, others: Sequence[str] = ()
) -> Path:
    """File of a scenario.

    Args:
        name_or_path: A shipped name, or the path of a YAML file (with a folder or a suffix).
        directory: Folder of the shipped scenarios.
        others: What else could be meant, for the message.

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
        return path  # reading says what is wrong with a pipe or a device
    if path.suffix in (".yaml", ".yml") or len(path.parts) > 1:
        reason = "is a folder" if is_folder else f"no such file{nearest_file(path)}"
        raise InputError(f"scenario file {shortened(name_or_path, 200)}: {reason}")
    hint = did_you_mean(name_or_path, [*names, *others], cutoff=0.5)
    wanted = shortened(repr(name_or_path))
    raise InputError(
        f"unknown scenario {wanted}: {hint}available: {', '.join(names) or 'none'},"
        " or the path of a YAML file"
    )


def expand_home(path: Path) -> Path:
    """Path with its leading ``~`` or ``~user`` replaced by the home folder.

    Raises:
        InputError: If there is no such home.
    """
    try:
        return path.expanduser()
    except RuntimeError:
        raise InputError(f"{path}: no home folder is known for {path.parts[0]}") from None


def list_scenarios(directory: Path = SCENARIO_DIRECTORY) -> list[CatalogEntry]:
    """Shipped scenarios with section and description, ordered by section, then name.

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
    """Catalog entry of one file."""
    data = read_yaml(path)
    description = " ".join(str(data.get("description", "")).split())
    return CatalogEntry(path.stem, str(data.get("section", "")), description)


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
        given = self.data.get("name")
        return given if isinstance(given, str) else stem

    @property
    def fingerprint(self) -> str:
        """SHA-256 of the content."""
        text = json.dumps([self.name, self.data], sort_keys=True, default=str)
        return hashlib.sha256(text.encode("utf-8", "backslashreplace")).hexdigest()

    def inputs(self) -> list[Path]:
        """Returns the file itself and every path that a text in it may stand for."""
        folder = self.path.parent
        return [self.path, *(folder / text for text in _texts(self.data))]


def read_scenario(
    name_or_path: str, overrides: list[str], others: Sequence[str] = ()
) -> ScenarioFile:
    """Finds and reads a scenario; see :func:`find_scenario` and :func:`load_scenario_data`."""
    path = find_scenario(name_or_path, others=others)
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
        data: Data of a scenario.
        override: What to set.
        option: Option of the command line, for messages.

    Raises:
        InputError: If the override is malformed, or goes through what is no mapping or list.
    """
    source = f"{option} {shortened(override, 100)}"
    path, separator, text = override.partition("=")
    keys = _keys(path if separator else "", source)
    _set(data, keys, parse_yaml(text, source), source)


def apply_change(data: dict[str, Any], key: str, value: Any) -> None:
    """Set one key in place to a value of Python.

    Args:
        data: Data of a scenario.
        key: ``key.path``, as in an override.
        value: Text, which is read as YAML as in an override, so that it may have a tag; or numbers,
            truth values, None, and lists, arrays and mappings of these, taken as they are.

    Raises:
        InputError: If the key is malformed or goes through what is no mapping or list, or the value
            is nothing that YAML could say.
    """
    source = f"change {shortened(f'{key} = {value!r}', 100)}"
    keys = _keys(key, source)
    _set(data, keys, _plain(value, source, len(keys)), source)


def _plain(value: Any, source: str, depth: int) -> Any:
    """A value of Python as YAML would give it."""
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
    """The keys of an override, from the root on."""
    keys = path.strip().split(".")
    if not all(keys):
        raise InputError(f"{source}: malformed; allowed: key.path=value")
    if len(keys) > MAX_DEPTH:
        raise InputError(f"{source}: {len(keys)} levels; allowed: up to {MAX_DEPTH}")
    return keys


def _set(data: dict[str, Any], keys: list[str], value: Any, source: str) -> None:
    """Put a value at its place, making mappings that are missing on the way."""
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
