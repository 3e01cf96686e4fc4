"""Reading a scenario file: YAML with typed mappings, and ``--set`` overrides on top."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from experiments.scenario_catalog import find_scenario
from pfsc_drake.errors import InputError

__all__ = ["ScenarioFile", "find_scenario", "load_scenario_data", "read_scenario"]


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
        """Key ``name`` of the file, else the file's name without suffix."""
        return str(self.data.get("name", self.path.stem))


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
        InputError: If the file is unreadable, invalid YAML or no mapping, holds a key twice, or an
            override is malformed.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not UTF-8 text"
        raise InputError(f"{path}: cannot be read: {reason}") from None
    data = _parse_yaml(text, str(path), private=False)
    if not isinstance(data, dict):
        kind = "empty" if data is None else f"a {type(data).__name__}"
        raise InputError(f"{path}: the root is {kind}; allowed: a mapping of scenario keys")
    for override in overrides:
        _apply_override(data, override)
    return data


def _parse_yaml(text: str, source: str, private: bool) -> Any:
    """YAML with tags kept as ``_tag``; one-line InputError for anything invalid."""
    from pydrake.common.yaml import yaml_load_data

    try:
        duplicate = _duplicate_key(yaml.compose(text, Loader=yaml.SafeLoader))
        data = _without_sharing(yaml_load_data(text, private=private))
    except RecursionError:
        raise InputError(
            f"{source}: an alias (*name) contains itself, or nesting is deep"
        ) from None
    except yaml.MarkedYAMLError as error:
        problem = error.problem or "not YAML"
        if problem == "expected a mapping node, but found scalar":
            problem = "a !Tag needs a mapping after it, e.g. !Tag {}"
        line = error.problem_mark.line + 1 if error.problem_mark else "?"
        raise InputError(f"{source}: invalid YAML in line {line}: {problem}") from None
    except yaml.YAMLError as error:
        raise InputError(f"{source}: invalid YAML: {' '.join(str(error).split())}") from None
    if duplicate is not None:
        key, line = duplicate
        raise InputError(f"{source}: key {key!r} appears a second time in line {line}")
    return data


def _duplicate_key(node: yaml.Node | None) -> tuple[str, int] | None:
    """First key that a mapping holds twice, with its line; YAML itself would keep the last."""
    children: list[yaml.Node] = []
    if isinstance(node, yaml.MappingNode):
        seen: set[str] = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in seen:
                    return key.value, key.start_mark.line + 1
                seen.add(key.value)
        children = [value for _, value in node.value]
    elif isinstance(node, yaml.SequenceNode):
        children = node.value
    return next((found for child in children if (found := _duplicate_key(child))), None)


def _without_sharing(data: Any) -> Any:
    """Data in which aliases (``*name``) are copies, so that an override changes one place only."""
    if isinstance(data, dict):
        return {key: _without_sharing(value) for key, value in data.items()}
    if isinstance(data, list):
        return [_without_sharing(value) for value in data]
    return data


def _apply_override(data: dict[str, Any], override: str) -> None:
    """Sets one ``key.path=value`` in place."""
    source = f"--set {override}"
    path, separator, text = override.partition("=")
    keys = path.strip().split(".")
    if not separator or not all(keys):
        raise InputError(f"{source}: malformed; allowed: key.path=value")
    value = _parse_yaml(text, source, private=True)
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
        raise InputError(f"{here} is {target!r} and has no key {key!r}")
    if not key.isdecimal() or int(key) >= len(target):
        allowed = f"0 to {len(target) - 1}" if target else "none, it is empty"
        raise InputError(f"{here} is a list, {key!r} is no index of it; allowed: {allowed}")
    return int(key)
