"""JSON schema of a dataclass, for completion and checks in editors.

It says what the reader (:mod:`pfsc_drake.yaml.typed`) checks of single keys: names, types, words,
bounds, lengths, defaults; what keys allow each other is known to the reader alone. JSON has no
YAML tags: a block that a tag chooses is one of several (``anyOf``), titled by their tags, and
:func:`tags_of` lists these for the editor. It is of draft 7, which editors of YAML read.
"""

import dataclasses
import math
import re
import types
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from pfsc_drake.yaml.dumping import typed_data
from pfsc_drake.yaml.fields import Field, attribute_text, fields_of
from pfsc_drake.yaml.rules import Numbers, Range, rules_of

_SCALARS = {bool: "boolean", int: "integer", float: "number", str: "string", Path: "string"}
_MARKUP = re.compile(r":\w+(?::\w+)*:`~?(?:[\w.]*\.)?([^`]+)`|``([^`]+)``")


def json_schema(owner: type, title: str) -> dict[str, Any]:
    """Return the JSON schema of a file.

    Args:
        owner: Dataclass that reads it; root keys that begin with ``_`` are allowed beside its own.
        title: What the file is.

    Raises:
        ValueError: If two of the dataclasses in it have one name.
    """
    blocks: dict[str, type] = {}
    for block in blocks_of(owner):
        if blocks.setdefault(block.__name__, block) is not block:
            raise ValueError(f"{block} and {blocks[block.__name__]} have one name")
    root = _block(owner)
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": title,
        **root,
        "patternProperties": {"^_": {}},
        "definitions": {name: _block(blocks[name]) for name in sorted(blocks)},
    }


def blocks_of(owner: type) -> Iterator[type]:
    """Yield the dataclasses that a dataclass is made of, itself excluded, each once."""
    found, ways = {owner}, [field.kind for field in fields_of(owner).values()]
    while ways:
        kind = ways.pop(0)
        ways += typing.get_args(kind)
        if dataclasses.is_dataclass(kind) and isinstance(kind, type) and kind not in found:
            found.add(kind)
            yield kind
            ways += [field.kind for field in fields_of(kind).values()]


def tags_of(owner: type) -> list[str]:
    """Return the tags that a file may have, sorted, each with its exclamation mark."""
    kinds = [
        field.kind for block in (owner, *blocks_of(owner)) for field in fields_of(block).values()
    ]
    found = {f"!{choice.__name__}" for kind in kinds for choice in _choices(kind)}
    return sorted(found)


def _choices(kind: Any) -> list[Any]:
    """Return the dataclasses of the unions of several that a type has."""
    arguments = typing.get_args(kind)
    inner = [choice for argument in arguments for choice in _choices(argument)]
    union = typing.get_origin(kind) in (typing.Union, types.UnionType)
    blocks = [member for member in arguments if dataclasses.is_dataclass(member)]
    return [*inner, *blocks] if union and len(blocks) > 1 else inner


def _block(owner: type) -> dict[str, Any]:
    """Return the schema of a mapping with the keys of a dataclass."""
    fields, plain = fields_of(owner), _defaults(owner)
    said: dict[str, Any] = {
        "type": "object",
        "description": _plain((owner.__doc__ or "").split("\n\n")[0]),
        "properties": {name: _field(owner, field, plain) for name, field in fields.items()},
        "additionalProperties": False,
    }
    required = [name for name, field in fields.items() if field.required]
    return said | ({"required": required} if required else {})


def _defaults(owner: type) -> dict[str, Any]:
    """Return the defaults of a dataclass that JSON can say: no blocks, nothing infinite."""
    data = (
        {}
        if any(field.default is None for field in fields_of(owner).values())
        else typed_data(owner())
    )
    return {name: value for name, value in data.items() if _is_plain(value)}


def _is_plain(value: Any) -> bool:
    if isinstance(value, list):
        return all(map(_is_plain, value))
    return not isinstance(value, dict) and not (isinstance(value, float) and math.isinf(value))


def _field(owner: type, field: Field, plain: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of a key."""
    said = _written(field, _typed(field.hint, field.bounds))
    if field.name in plain and not field.required:
        said["default"] = plain[field.name] or field.form.get("empty_word", plain[field.name])
    text = _plain(attribute_text(owner, field.name) or "")
    if field.name.endswith("_deg") and "[" not in text:
        text += " [deg]"
    # beside a reference nothing else counts
    said = {"allOf": [said]} if "$ref" in said else said
    return {"description": text, **said} if text else said


def _written(field: Field, said: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of what may be written for a value of a field."""
    form, single = field.form, [said["items"]] if field.takes_a_number else []
    if "words" in form:
        item = {"anyOf": [{"type": "number"}, {"enum": list(form["words"])}]}
        return {**said, "items": item}
    if form.get("parts", 1) > 1:
        said = {**said, "minItems": form["parts"]}
    if "empty_word" in form:
        single.append({"const": form["empty_word"]})
    return {"anyOf": [said, *single]} if single else said


def _typed(hint: Any, bounds: Range | None) -> dict[str, Any]:
    """Return the schema of a type.

    Args:
        hint: The type with its rules.
        bounds: Of its numbers, by their unit.
    """
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is Annotated:
        return _ruled(hint, bounds)
    if origin in (typing.Union, types.UnionType):
        return {"anyOf": [_member(member, bounds, hint) for member in arguments]}
    if origin is list:
        return {"type": "array", "items": _typed(arguments[0], bounds)}
    if origin is dict:
        return {"type": "object", "additionalProperties": _typed(arguments[1], bounds)}
    if hint is np.ndarray:
        return {"type": "array", "items": _typed(float, bounds)}
    if hint is types.NoneType:
        return {"type": "null"}
    if dataclasses.is_dataclass(hint):
        return {"$ref": f"#/definitions/{hint.__name__}"}  # type: ignore[union-attr]
    said: dict[str, Any] = {"type": _SCALARS[hint]}
    return said | (bounds.json() if bounds is not None and hint in (int, float) else {})


def _member(member: Any, bounds: Range | None, union: Any) -> dict[str, Any]:
    """Return the schema of a member of a union, with the tag that chooses it as its title."""
    said = _typed(member, bounds)
    return {"title": f"!{member.__name__}", "allOf": [said]} if member in _choices(union) else said


def _ruled(hint: Any, bounds: Range | None) -> dict[str, Any]:
    """Return the schema of a type with rules, which are tighter than bounds by units."""
    said = _typed(typing.get_args(hint)[0], bounds)
    for rule in rules_of(hint):
        own = rule.json()
        if isinstance(rule, Range):
            said = _within(said, own)
        elif isinstance(rule, Numbers):
            item = _typed(Annotated[float, rule.each], bounds)
            said = {**said, **own, "items": item}
        else:
            said = {**said, **own}
    return said


def _within(said: dict[str, Any], own: dict[str, Any]) -> dict[str, Any]:
    """Return a schema of numbers with the tighter of two bounds on either side."""
    least, most = own.get("exclusiveMinimum", own.get("minimum")), own.get("maximum")
    if least is not None and least >= said.get("minimum", least):
        said = {key: value for key, value in said.items() if key != "minimum"}
    elif least is not None:
        own = {key: value for key, value in own.items() if not key.endswith("inimum")}
    if most is not None and most > said.get("maximum", most):
        own = {key: value for key, value in own.items() if key != "maximum"}
    return {**said, **own}


def _plain(text: str) -> str:
    """Return text of a docstring without its markup, in one line."""
    return " ".join(_MARKUP.sub(lambda match: match[1] or match[2], text).split())
