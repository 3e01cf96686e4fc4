"""JSON schema of a dataclass, for completion and checks in editors.

It covers the checks of single keys by the reader (:mod:`pfsc_drake.yaml.typed`): names, types,
words, bounds, lengths, defaults. Checks across keys are left to the reader. JSON has no YAML tags:
a block that a tag chooses is one of several (``anyOf``), titled by their tags, and :func:`tags_of`
lists these for the editor. The schema is of draft 7, which YAML editors read.
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
        owner: Dataclass of the file; root keys that begin with ``_`` are allowed beside its own.
        title: Title of the schema.

    Raises:
        ValueError: If two of its dataclasses have the same name.
    """
    blocks: dict[str, type] = {}
    for block in blocks_of(owner):
        if blocks.setdefault(block.__name__, block) is not block:
            raise ValueError(f"{block} and {blocks[block.__name__]} have one name")
    root = _block_schema(owner)
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": title,
        **root,
        "patternProperties": {"^_": {}},
        "definitions": {name: _block_schema(blocks[name]) for name in sorted(blocks)},
    }


def blocks_of(owner: type) -> Iterator[type]:
    """Yield all dataclasses within a dataclass, itself excluded, each once."""
    found, pending = {owner}, [field.kind for field in fields_of(owner).values()]
    while pending:
        kind = pending.pop(0)
        pending += typing.get_args(kind)
        if dataclasses.is_dataclass(kind) and isinstance(kind, type) and kind not in found:
            found.add(kind)
            yield kind
            pending += [field.kind for field in fields_of(kind).values()]


def tags_of(owner: type) -> list[str]:
    """Return the allowed tags of a file, sorted, each with its exclamation mark."""
    kinds = [
        field.kind for block in (owner, *blocks_of(owner)) for field in fields_of(block).values()
    ]
    found = {f"!{choice.__name__}" for kind in kinds for choice in _choices(kind)}
    return sorted(found)


def _choices(kind: Any) -> list[Any]:
    """Return the dataclasses in a type's unions of several dataclasses."""
    arguments = typing.get_args(kind)
    inner = [choice for argument in arguments for choice in _choices(argument)]
    union = typing.get_origin(kind) in (typing.Union, types.UnionType)
    blocks = [member for member in arguments if dataclasses.is_dataclass(member)]
    return [*inner, *blocks] if union and len(blocks) > 1 else inner


def _block_schema(owner: type) -> dict[str, Any]:
    """Return the schema of a mapping with the keys of a dataclass."""
    fields, plain = fields_of(owner), _defaults(owner)
    schema: dict[str, Any] = {
        "type": "object",
        "description": _plain((owner.__doc__ or "").split("\n\n")[0]),
        "properties": {name: _field_schema(owner, field, plain) for name, field in fields.items()},
        "additionalProperties": False,
    }
    required = [name for name, field in fields.items() if field.required]
    return schema | ({"required": required} if required else {})


def _defaults(owner: type) -> dict[str, Any]:
    """Return the defaults of a dataclass that JSON can represent: no blocks, nothing infinite."""
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


def _field_schema(owner: type, field: Field, plain: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of a key."""
    schema = _input_schema(field, _type_schema(field.hint, field.bounds))
    if field.name in plain and not field.required:
        schema["default"] = plain[field.name] or field.form.get("empty_word", plain[field.name])
    text = _plain(attribute_text(owner, field.name) or "")
    if field.name.endswith("_deg") and "[" not in text:
        text += " [deg]"
    # JSON schema ignores everything beside a reference
    schema = {"allOf": [schema]} if "$ref" in schema else schema
    return {"description": text, **schema} if text else schema


def _input_schema(field: Field, schema: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of a field with all accepted spellings."""
    form, single = field.form, [schema["items"]] if field.takes_a_number else []
    if "words" in form:
        item = {"anyOf": [{"type": "number"}, {"enum": list(form["words"])}]}
        return {**schema, "items": item}
    if form.get("parts", 1) > 1:
        schema = {**schema, "minItems": form["parts"]}
    if "empty_word" in form:
        single.append({"const": form["empty_word"]})
    return {"anyOf": [schema, *single]} if single else schema


def _type_schema(hint: Any, bounds: Range | None) -> dict[str, Any]:
    """Return the schema of a type.

    Args:
        hint: The type with its rules.
        bounds: Bounds of its numbers, by their unit.
    """
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is Annotated:
        return _rule_schema(hint, bounds)
    if origin in (typing.Union, types.UnionType):
        return {"anyOf": [_member_schema(member, bounds, hint) for member in arguments]}
    if origin is list:
        return {"type": "array", "items": _type_schema(arguments[0], bounds)}
    if origin is dict:
        return {"type": "object", "additionalProperties": _type_schema(arguments[1], bounds)}
    if hint is np.ndarray:
        return {"type": "array", "items": _type_schema(float, bounds)}
    if hint is types.NoneType:
        return {"type": "null"}
    if dataclasses.is_dataclass(hint):
        return {"$ref": f"#/definitions/{hint.__name__}"}  # type: ignore[union-attr]
    schema: dict[str, Any] = {"type": _SCALARS[hint]}
    return schema | (bounds.json() if bounds is not None and hint in (int, float) else {})


def _member_schema(member: Any, bounds: Range | None, union: Any) -> dict[str, Any]:
    """Return the schema of a member of a union, with the tag that chooses it as its title."""
    schema = _type_schema(member, bounds)
    return (
        {"title": f"!{member.__name__}", "allOf": [schema]} if member in _choices(union) else schema
    )


def _rule_schema(hint: Any, bounds: Range | None) -> dict[str, Any]:
    """Return the schema of a type with rules, which are tighter than bounds by units."""
    schema = _type_schema(typing.get_args(hint)[0], bounds)
    for rule in rules_of(hint):
        own = rule.json()
        if isinstance(rule, Range):
            schema = _tighter_range(schema, own)
        elif isinstance(rule, Numbers):
            item = _type_schema(Annotated[float, rule.each], bounds)
            schema = {**schema, **own, "items": item}
        else:
            schema = {**schema, **own}
    return schema


def _tighter_range(schema: dict[str, Any], own: dict[str, Any]) -> dict[str, Any]:
    """Return a schema of numbers with the tighter of two bounds on either side."""
    least, most = own.get("exclusiveMinimum", own.get("minimum")), own.get("maximum")
    if least is not None and least >= schema.get("minimum", least):
        schema = {key: value for key, value in schema.items() if key != "minimum"}
    elif least is not None:
        own = {key: value for key, value in own.items() if not key.endswith("inimum")}
    if most is not None and most > schema.get("maximum", most):
        own = {key: value for key, value in own.items() if key != "maximum"}
    return {**schema, **own}


def _plain(text: str) -> str:
    """Return docstring text without markup, in one line."""
    return " ".join(_MARKUP.sub(lambda match: match[1] or match[2], text).split())
