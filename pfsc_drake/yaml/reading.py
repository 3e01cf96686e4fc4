"""YAML files as plain data and back, with messages that name file and line.

A mapping with a tag, ``!Circle {radius: 1}``, has the tag as one more key, as in Drake:
``{"radius": 1, "_tag": "!Circle"}``. Drake itself is not imported: its import is slow, and it
silently accepts a key that appears twice.

A document may have MAX_NODES values and keys after its aliases have been copied, and MAX_DEPTH
levels; both are counted before anything is copied.
"""

import dataclasses
import os
import stat
from pathlib import Path
from typing import Any, NoReturn

import yaml

from pfsc_drake.errors import InputError, nearest_file, shorten
from pfsc_drake.yaml.source import KeyPath, join_keys

MAX_BYTES = 1_000_000  # of a YAML file


def find_status(path: Path) -> os.stat_result | None:
    """Returns the file status of a path; None if there is no such file, or cannot be."""
    try:
        return path.stat()
    except (OSError, ValueError):  # e.g. a name that is too long, a NUL in it
        return None


def read_text(path: Path, max_bytes: int = MAX_BYTES) -> str:
    """Returns the text of a regular file.

    Pipes, devices and folders are refused before they are opened: opening or reading one may block
    forever.

    Args:
        path: Path of the file; links are followed.
        max_bytes: Largest size that is read.

    Raises:
        InputError: If the file cannot be read, is not a regular file, is too large or not UTF-8;
            one line with its name.
    """
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            kind = "a folder" if stat.S_ISDIR(status.st_mode) else "a pipe, socket or device"
            raise InputError(f"{path}: cannot be read: is {kind}; allowed: a file")
        if status.st_size > max_bytes:
            raise InputError(
                f"{path}: cannot be read: {status.st_size} bytes; allowed: up to {max_bytes}"
            )
        with path.open("rb") as file:
            # a file may grow meanwhile, and files of /proc claim to be empty
            content = file.read(max_bytes + 1)
    except InputError:
        raise
    except OSError as error:
        nearest = nearest_file(path) if isinstance(error, FileNotFoundError) else ""
        reason = f"{os.strerror(error.errno or 0)}{nearest}"
        raise InputError(f"{path}: cannot be read: {reason}") from None
    except ValueError:  # a NUL in the name
        raise InputError(f"{str(path)!r}: cannot be read: no name of a file") from None
    if len(content) > max_bytes:
        raise InputError(f"{path}: cannot be read: allowed: up to {max_bytes} bytes")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError:
        raise InputError(f"{path}: cannot be read: not UTF-8 text") from None


def resolve_files(value: Any, folder: Path) -> None:
    """Makes file names in a dataclass absolute, in place, so that it can be saved anywhere.

    Empty names and URIs are not changed.

    Args:
        value: Dataclass, or a list or mapping of dataclasses, whose fields are declared with FILE
            and NAME_OR_FILE.
        folder: Base folder of relative names.
    """
    if isinstance(value, list):
        for item in value:
            resolve_files(item, folder)
    elif isinstance(value, dict):
        for item in value.values():
            resolve_files(item, folder)
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            content = getattr(value, field.name)
            if "file" not in field.metadata:
                resolve_files(content, folder)
            elif isinstance(content, dict):
                resolved = {key: _absolute_path(name, folder) for key, name in content.items()}
                setattr(value, field.name, resolved)
            elif field.metadata["file"] or Path(content).suffix:
                setattr(value, field.name, _absolute_path(content, folder))


def _absolute_path(name: str, folder: Path) -> str:
    return str((folder / name).resolve()) if name and "://" not in name else name


TAG_KEY = "_tag"
MAX_NODES = 100_000
MAX_DEPTH = 100
_LONGEST_NUMBER = 100  # characters, of a sexagesimal number
_NUMBER_TAGS = ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")


class _Loader(yaml.SafeLoader):
    """A loader that keeps tags, with readable messages."""


class _QuickLoader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """A faster loader with the same results for valid text."""


class _Dumper(getattr(yaml, "CSafeDumper", yaml.SafeDumper)):  # type: ignore[misc]
    """A dumper that writes tags."""


def _construct_tagged(loader: yaml.SafeLoader, tag: str, node: yaml.Node) -> dict[str, Any]:
    return {**loader.construct_mapping(node), TAG_KEY: tag}


def _represent_mapping(dumper: yaml.SafeDumper, data: dict[str, Any]) -> yaml.Node:
    tag = data.get(TAG_KEY, "tag:yaml.org,2002:map")
    content = {key: value for key, value in data.items() if key != TAG_KEY}
    return dumper.represent_mapping(tag, content)


def _represent_list(dumper: yaml.SafeDumper, data: list[Any]) -> yaml.Node:
    """Puts scalars into one line."""
    flow = not any(isinstance(item, (dict, list)) for item in data)
    return dumper.represent_sequence("tag:yaml.org,2002:seq", data, flow_style=flow)


for _loader in (_Loader, _QuickLoader):
    _loader.add_multi_constructor("", _construct_tagged)
_Dumper.add_representer(dict, _represent_mapping)
_Dumper.add_representer(list, _represent_list)


def read_yaml(path: Path) -> dict[str, Any]:
    """Reads a file with a mapping at its root.

    Args:
        path: Path of the file. Root keys that start with ``_`` are private (for anchors) and
            dropped.

    Returns:
        The data.

    Raises:
        InputError: If the file is unreadable (see :func:`pfsc_drake.yaml.reading.read_text`), has
            no mapping at its root, or is refused by :func:`parse_yaml`. One line that names the
            file and, if there is one, the line in it.
    """
    return read_with_lines(path)[0]


def read_with_lines(path: Path) -> tuple[dict[str, Any], dict[str, int]]:
    """Reads a file as :func:`read_yaml`, and returns the lines of its keys as well.

    Args:
        path: Path of the file.

    Returns:
        The data; and the line of every key and list item by its key path, such as
        ``controller.gains.eta[1]``, for an alias that of its anchor.

    Raises:
        InputError: As :func:`read_yaml`.
    """
    data, node = _parse(read_text(path), str(path))
    if not isinstance(data, dict):
        kind = "empty" if data is None else f"a {type(data).__name__}"
        raise InputError(f"{path}: the root is {kind}; allowed: a mapping of keys to values")
    lines: dict[str, int] = {}
    _find_lines(node, (), lines)
    data = {
        key: value for key, value in data.items() if key == TAG_KEY or not str(key).startswith("_")
    }
    return data, {key: line for key, line in lines.items() if not key.startswith("_")}


def parse_yaml(text: str, source: str) -> Any:
    """Returns the data of a YAML text; aliases (``*name``) become copies.

    Args:
        text: One YAML document.
        source: Name of the text, for messages.

    Raises:
        InputError: If the text is invalid, contains a key twice, is too large or too deep after its
            aliases have been copied, or contains characters that no file name can have; one line.
    """
    return _parse(text, source)[0]


def _parse(text: str, source: str) -> tuple[Any, yaml.Node | None]:
    """Return the data of a YAML text, and its nodes with merged keys (``<<``) in place."""
    try:
        _refuse_depth(text, source)
        loader, node = _compose(text)
        if node is not None:
            _NodeCheck(source).check(node)
        data = None if node is None else _copy_aliases(loader.construct_document(node))
        return data, node
    except InputError:
        raise
    except RecursionError:
        raise InputError(f"{source}: {_TOO_DEEP}") from None
    except yaml.MarkedYAMLError as error:
        problem = error.problem or "not YAML"
        if problem.startswith("expected a mapping node, but found"):
            problem = "a !Tag needs a mapping after it, e.g. !Tag {}"
        line = error.problem_mark.line + 1 if error.problem_mark else "?"
        raise InputError(f"{source}: invalid YAML in line {line}: {problem}") from None
    except (yaml.YAMLError, ValueError, LookupError, AttributeError, TypeError) as error:
        # PyYAML lets the others than YAMLError out of e.g. 2020-02-31, !!bool x, !!int "".
        raise InputError(f"{source}: invalid YAML: {' '.join(str(error).split())}") from None


def _find_lines(node: yaml.Node | None, key_path: KeyPath, lines: dict[str, int]) -> None:
    """Add the lines of all keys and list items below a node, by their key paths."""
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            _add_line(key, value, (*key_path, str(key.value)), lines)
    elif isinstance(node, yaml.SequenceNode):
        for index, item in enumerate(node.value):
            _add_line(item, item, (*key_path, index), lines)


def _add_line(start: yaml.Node, value: yaml.Node, key_path: KeyPath, lines: dict[str, int]) -> None:
    lines[join_keys(key_path)] = start.start_mark.line + 1
    _find_lines(value, key_path, lines)


def _compose(text: str) -> tuple[Any, yaml.Node | None]:
    """Return a loader, and the nodes of the only document in a text."""
    try:
        quick = _QuickLoader(text)
        return quick, quick.get_single_node()
    except (yaml.YAMLError, ValueError):
        loader = _Loader(text)
        return loader, loader.get_single_node()


def _refuse_depth(text: str, source: str) -> None:
    """Check the number of levels without building anything: libyaml builds in recursion.

    Raises:
        InputError: If there are more than MAX_DEPTH.
    """
    depth, line = 0, None
    try:
        for event in yaml.parse(text, Loader=_QuickLoader):
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth > MAX_DEPTH:
                line = event.start_mark.line + 1
                break
    except (yaml.YAMLError, ValueError):
        return  # the loader reports it
    if line is not None:
        raise InputError(f"{source}: line {line}: {_TOO_DEEP}")


def dump_yaml(data: Any) -> str:
    """Returns data as YAML text, with tags and in their order; inverse of :func:`parse_yaml`."""
    return yaml.dump(data, Dumper=_Dumper, sort_keys=False)


_TOO_DEEP = f"nested too deeply; allowed: up to {MAX_DEPTH} levels"


class _NodeCheck:
    """Checks of nodes that YAML allows and plain data cannot represent; shared nodes only once."""

    def __init__(self, source: str) -> None:
        self._source = source
        self._sizes: dict[int, tuple[int, int]] = {}  # nodes and levels, by identity of the node
        self._open: set[int] = set()

    def check(self, node: yaml.Node) -> tuple[int, int]:
        """Returns the numbers of nodes and levels of a node after its aliases have been copied."""
        key = id(node)
        if key in self._open:
            self._refuse(node, "an alias (*name) contains itself")
        if key not in self._sizes:
            self._open.add(key)
            self._sizes[key] = self._measure(node)
            self._open.remove(key)
        return self._sizes[key]

    def _measure(self, node: yaml.Node) -> tuple[int, int]:
        """Counts the nodes of a node whose children have been checked."""
        children: list[yaml.Node] = []
        if isinstance(node, yaml.ScalarNode):
            self._check_text(node)
        elif isinstance(node, yaml.MappingNode):
            self._refuse_duplicate_keys(node)
            children = [child for pair in node.value for child in pair]
        elif isinstance(node, yaml.SequenceNode):
            children = node.value
        sizes = [self.check(child) for child in children]
        total = 1 + sum(size for size, _ in sizes)
        depth = 1 + max((depth for _, depth in sizes), default=0)
        if total > MAX_NODES:
            what = f"{total} values and keys, with aliases (*name) written out"
            self._refuse(node, f"{shorten(what, 100)}; allowed: up to {MAX_NODES}")
        if depth > MAX_DEPTH:
            self._refuse(node, _TOO_DEEP)
        return total, depth

    def _refuse_duplicate_keys(self, node: yaml.MappingNode) -> None:
        """Raises InputError at the first key that appears twice in a mapping."""
        names: set[str] = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in names:
                    where = f"a second time in line {key.start_mark.line + 1}"
                    name = shorten(repr(key.value))
                    raise InputError(f"{self._source}: key {name} appears {where}")
                names.add(key.value)

    def _check_text(self, node: yaml.ScalarNode) -> None:
        """Raises InputError at a character that neither files nor their names can have."""
        if any(character == "\0" or "\ud800" <= character <= "\udfff" for character in node.value):
            text = shorten(ascii(node.value))
            self._refuse(node, f"{text} holds a NUL or half a character; allowed: text")
        if node.tag in _NUMBER_TAGS and ":" in node.value and len(node.value) > _LONGEST_NUMBER:
            length = len(node.value)
            self._refuse(node, f"a number of {length} characters; allowed: up to {_LONGEST_NUMBER}")

    def _refuse(self, node: yaml.Node, reason: str) -> NoReturn:
        raise InputError(f"{self._source}: line {node.start_mark.line + 1}: {reason}")


def _copy_aliases(data: Any) -> Any:
    """Return data in which aliases are copies, so that a change affects one of them only."""
    if isinstance(data, dict):
        return {key: _copy_aliases(value) for key, value in data.items()}
    if isinstance(data, list):
        return [_copy_aliases(value) for value in data]
    return data
