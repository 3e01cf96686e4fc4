"""Reading YAML into plain data, with errors a person can act on, and writing it again.

A mapping with a tag, ``!Circle {radius: 1}``, is held as Drake holds it, with the tag as one more
key: ``{"radius": 1, "_tag": "!Circle"}``. Drake itself is not imported: it is slow to import and,
of a key that is there twice, keeps the second without a word.
"""

from pathlib import Path
from typing import Any

import yaml

from pfsc_drake.errors import InputError

TAG_KEY = "_tag"


class _Loader(yaml.SafeLoader):
    """Keeps tags."""


class _Dumper(yaml.SafeDumper):
    """Writes tags."""


def _construct_tagged(loader: yaml.SafeLoader, tag: str, node: yaml.Node) -> dict[str, Any]:
    return {**loader.construct_mapping(node), TAG_KEY: tag}


def _represent_mapping(dumper: yaml.SafeDumper, data: dict[str, Any]) -> yaml.Node:
    tag = data.get(TAG_KEY, "tag:yaml.org,2002:map")
    content = {key: value for key, value in data.items() if key != TAG_KEY}
    return dumper.represent_mapping(tag, content)


_Loader.add_multi_constructor("", _construct_tagged)
_Dumper.add_representer(dict, _represent_mapping)


def read_yaml(path: Path) -> dict[str, Any]:
    """Reads a file with a mapping at its root.

    Args:
        path: of the file. Root keys that start with ``_`` are private (places for anchors) and
            dropped.

    Returns:
        The data.

    Raises:
        InputError: if the file is unreadable, not UTF-8, invalid YAML or no mapping, or holds a key
            twice. One line that names the file and, where there is one, the line in it.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not UTF-8 text"
        raise InputError(f"{path}: cannot be read: {reason}") from None
    data = parse_yaml(text, str(path))
    if not isinstance(data, dict):
        kind = "empty" if data is None else f"a {type(data).__name__}"
        raise InputError(f"{path}: the root is {kind}; allowed: a mapping of keys to values")
    return {
        key: value for key, value in data.items() if key == TAG_KEY or not str(key).startswith("_")
    }


def parse_yaml(text: str, source: str) -> Any:
    """Returns the data of a YAML text; aliases (``*name``) become copies.

    Args:
        text: one YAML document.
        source: name of the text, for messages.

    Raises:
        InputError: if the text is invalid or holds a key twice; one line.
    """
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
        _refuse_duplicate_keys(node, source)
        return None if node is None else _without_sharing(loader.construct_document(node))
    except InputError:
        raise
    except RecursionError:
        reason = "an alias (*name) contains itself, or nesting is deep"
        raise InputError(f"{source}: {reason}") from None
    except yaml.MarkedYAMLError as error:
        problem = error.problem or "not YAML"
        if problem.startswith("expected a mapping node, but found"):
            problem = "a !Tag needs a mapping after it, e.g. !Tag {}"
        line = error.problem_mark.line + 1 if error.problem_mark else "?"
        raise InputError(f"{source}: invalid YAML in line {line}: {problem}") from None
    except (yaml.YAMLError, ValueError, KeyError, AttributeError) as error:
        # PyYAML lets the others than YAMLError out of e.g. 2020-02-31, !!bool x, !!timestamp x.
        raise InputError(f"{source}: invalid YAML: {' '.join(str(error).split())}") from None


def dump_yaml(data: Any) -> str:
    """Returns data as YAML text, with tags, in the order of its keys; undoes :func:`parse_yaml`."""
    return yaml.dump(data, Dumper=_Dumper, sort_keys=False)


def _refuse_duplicate_keys(node: yaml.Node | None, source: str) -> None:
    """Raises InputError at the first key that a mapping holds twice."""
    children: list[yaml.Node] = []
    if isinstance(node, yaml.MappingNode):
        seen: set[str] = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in seen:
                    where = f"a second time in line {key.start_mark.line + 1}"
                    raise InputError(f"{source}: key {key.value!r} appears {where}")
                seen.add(key.value)
        children = [value for _, value in node.value]
    elif isinstance(node, yaml.SequenceNode):
        children = node.value
    for child in children:
        _refuse_duplicate_keys(child, source)


def _without_sharing(data: Any) -> Any:
    """Data in which aliases are copies, so that a change to it changes one place only."""
    if isinstance(data, dict):
        return {key: _without_sharing(value) for key, value in data.items()}
    if isinstance(data, list):
        return [_without_sharing(value) for value in data]
    return data
