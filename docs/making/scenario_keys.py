"""Page of the keys of a scenario, generated from its dataclasses."""

import dataclasses as dc
import math
import re
import types
import typing
from collections.abc import Iterator
from typing import Any

import numpy as np

from diagrams.scenario import Scenario
from docs.making.text import attribute, cell, description, table
from pfsc_drake.yaml.dumping import typed_data
from pfsc_drake.yaml.fields import AUTO_OR_MANY, FILE, NAME_OR_FILE, ONE_OR_MANY, Field, fields_of
from pfsc_drake.yaml.rules import OneOf, rules_of

_PLAIN = {bool: "true or false", int: "whole number", float: "number", str: "text"}
_SEVERAL = {
    "whole number": "whole numbers",
    "number": "numbers",
    "text": "texts",
    "true or false": "true or false",
}
# brackets contain units or examples of lists
_BRACKETS = re.compile(r" ?\[([^\[\]]*)\]")
_WORD = re.compile(r"[A-Za-z%]+")
_UNIT_WORDS = "m mm s ms kg N Nm J W V A rad deg Hz Pa K or and"
_UNITS = set(_UNIT_WORDS.split())
_HEAD = ["Key", "Type", "Unit", "Default", "Meaning"]


@dc.dataclass
class _Block:
    """Dataclass and its key paths in a scenario."""

    owner: type
    key_paths: list[str]


def scenario_keys() -> str:
    """Return all keys of a scenario as Markdown, blocks in the order of a file."""
    found = blocks()
    several = [block for block in found.values() if len(block.key_paths) > 1]
    page = [_own_table(Scenario)]
    for field in dc.fields(Scenario):
        inside = [
            block
            for block in found.values()
            if len(block.key_paths) == 1 and _top(block.key_paths[0]) == field.name
        ]
        if inside and not _is_whole(inside[0], field.name):
            page += [f"## `{field.name}`", cell(attribute(Scenario, field.name))]
        for block in inside:
            page += _section(block, "##" if _is_whole(block, field.name) else "###")
    page.append("## Blocks with several key paths")
    for block in several:
        page += _section(block, "###")
    return "\n\n".join(page)


def unit_and_meaning(text: str, name: str) -> tuple[str, str]:
    """Return the unit in brackets of a docstring, and the rest of the docstring.

    Args:
        text: Docstring of an attribute.
        name: Name of the attribute; ``_deg`` at the end is a unit, too.
    """
    if text.startswith("["):  # the docstring has only a unit
        text = f"{name.replace('_', ' ').capitalize()} {text}"
    units = [unit for unit in _BRACKETS.findall(text) if set(_WORD.findall(unit)) <= _UNITS]
    units = [unit for unit in units if _WORD.search(unit)]
    if len(units) == 1:
        return units[0], text.replace(f" [{units[0]}]", "")
    return (" or ".join(units) or ("deg" if name.endswith("_deg") else "")), text


def _top(key_path: str) -> str:
    return re.split(r"[.\[ ]", key_path)[0]


def blocks() -> dict[type, _Block]:
    """Return all blocks by class, in the order of a file."""
    found: dict[type, _Block] = {}

    def walk(owner: type, prefix: str) -> None:
        hints = typing.get_type_hints(owner)
        for field in dc.fields(owner):
            here = f"{prefix}.{field.name}" if prefix else field.name
            choices = list(_members(hints[field.name]))
            for kind, suffix in choices:
                path = f"{here}{suffix}"
                if len([c for c in choices if dc.is_dataclass(c[0])]) > 1:
                    path += f" !{kind.__name__}"
                if dc.is_dataclass(kind):
                    found.setdefault(kind, _Block(kind, [])).key_paths.append(path)
                    walk(kind, path)

    walk(Scenario, "")
    return found


def _members(kind: Any, suffix: str = "") -> Iterator[tuple[Any, str]]:
    """Yield the possible types of a value, and the suffix of the key path for each."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        for argument in arguments:
            yield from _members(argument, suffix)
    elif origin is list:
        yield from _members(arguments[0], f"{suffix}[]")
    elif origin is dict:
        yield from _members(arguments[1], f"{suffix}.NAME")
    else:
        yield kind, suffix


def _is_whole(block: _Block, key: str) -> bool:
    """Return whether a block is the only content of a key of the scenario."""
    return block.key_paths[0] in (key, f"{key}[]")


def _section(block: _Block, level: str) -> list[str]:
    alone = len(block.key_paths) == 1
    tagged = " !" in block.key_paths[0]
    name = f"!{block.owner.__name__}" if tagged else block.owner.__name__
    parts = [
        f"({_anchor(block.owner)})=",
        f"{level} `{block.key_paths[0] if alone else name}`",
        description(block.owner),
    ]
    if not alone:
        parts.append("At " + ", ".join(f"`{path}`" for path in block.key_paths) + ".")
    if dc.fields(block.owner):
        parts.append(_own_table(block.owner))
    return parts


def _own_table(owner: type) -> str:
    plain, rows = owner(), []
    for name, field in fields_of(owner).items():
        unit, meaning = unit_and_meaning(attribute(owner, name), name)
        default = _default(getattr(plain, name), field)
        rows.append([f"`{name}`", _kind(field), cell(unit), default, cell(meaning)])
    return table(_HEAD, rows, "keys")


def _anchor(owner: type) -> str:
    return f"keys-{owner.__name__.lower()}"


def _kind(field: Field) -> str:
    """Return a field's type in words, blocks as links."""
    text = _words(field.kind)
    choices = [rule.allowed for rule in rules_of(field.hint) if isinstance(rule, OneOf)]
    for words in choices:
        text = text.replace("text", " or ".join(f"`{word}`" for word in words), 1)
    if field.form == FILE:
        return text.replace("text", "file", 1)
    if field.form == NAME_OR_FILE:
        return text.replace("text", "name or file", 1)
    if field.form == ONE_OR_MANY:
        return f"number, or {text}"
    return f"`auto`, or {text}" if field.form == AUTO_OR_MANY else text


def _words(hint: Any) -> str:
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        members = [member for member in arguments if member is not type(None)]
        null = ["`null`"] if type(None) in arguments else []
        if not all(dc.is_dataclass(member) for member in members) or len(members) == 1:
            return " or ".join([*map(_words, members), *null])
        return ", ".join([*(_tag(member) for member in members), *null])
    if origin is list:
        (item,) = arguments
        if typing.get_origin(item) is list:
            return "list of lists of numbers"
        inner = _words(item)
        return f"list of {_SEVERAL.get(inner, inner)}"
    if origin is dict:
        return f"names, each with {_words(arguments[1])}"
    if hint is np.ndarray:
        return "list of numbers"
    if dc.is_dataclass(hint):
        return f"[block](#{_anchor(typing.cast(type, hint))})"
    return _PLAIN[hint]


def _tag(owner: type) -> str:
    return f"[`!{owner.__name__}`](#{_anchor(owner)})"


def _default(value: Any, field: Field) -> str:
    if field.required:
        return "*required*"
    if field.form == AUTO_OR_MANY and not value:
        return "`auto`"
    if dc.is_dataclass(value):
        owner = type(value)
        tag = f"`!{owner.__name__}`" if len(list(_members(field.kind))) > 1 else ""
        data, plain = typed_data(value), typed_data(owner())
        changed = {key: item for key, item in data.items() if item != plain[key]}
        return " ".join(part for part in (tag, f"`{_yaml(changed)}`" if changed else "") if part)
    if isinstance(value, str):
        return f"`{value}`" if value else "empty"
    if isinstance(value, list) and any(dc.is_dataclass(item) for item in value):
        return f"{len(value)} of them"
    return f"`{_yaml(value)}`"


def _yaml(value: Any) -> str:
    """Return a value as YAML in one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_yaml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, (list, np.ndarray)):
        return "[" + ", ".join(_yaml(item) for item in value) + "]"
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    if isinstance(value, float) and math.isinf(value):
        return ".inf" if value > 0.0 else "-.inf"
    return f"{value:.10g}" if isinstance(value, float) else str(value)
