"""Single values and words where a schema has a list."""

import dataclasses
import types
import typing
from collections.abc import Sequence
from typing import Any

from pfsc_drake.checks import equal as equal
from pfsc_drake.yaml.reading import TAG_KEY
from pfsc_drake.yaml.schema_check import Place, is_number

# metadata of a list: its only item may be given without list
ONE_OR_MANY = {"one_or_many": True}
# metadata of a list of numbers: one without list stands for as many equal ones as are needed
ONE_FOR_ALL = {"one_for_all": True}
# the same of a list for which ``auto`` says that it is empty
AUTO_OR_MANY = {"empty_word": "auto", "one_for_all": True}
# metadata of a list of numbers: ``end`` may stand for one of them
NUMBERS_OR_END = {"words": ("end",)}


class OneForAll(list[float]):
    """A list of one number that stands for as many equal ones as are needed."""


def spread(values: list[float], count: int) -> list[float]:
    """Return a list, or as many equal numbers as are needed if it is one for all of them.

    Args:
        values: From a field that is declared with ONE_FOR_ALL.
        count: How many are needed.
    """
    return list(values) * count if isinstance(values, OneForAll) else values


def as_lists(schema: Any, data: Any, place: Place, singles: list[Place]) -> Any:
    """Returns data with lists wherever a schema allows a single item or a word for a list.

    Args:
        schema: Dataclass, or type of one of its fields.
        data: As :func:`pfsc_drake.yaml.reading.read_yaml` returns it; it stays as it is.
        place: Where the data are.
        singles: Gets the places of numbers that are one for all.
    """
    origin, arguments = typing.get_origin(schema), typing.get_args(schema)
    if origin in (typing.Union, types.UnionType):
        return as_lists(_choice(arguments, data), data, place, singles)
    if origin is list and isinstance(data, list):
        items = enumerate(data)
        return [as_lists(arguments[0], item, (*place, i), singles) for i, item in items]
    if not isinstance(data, dict):
        return data
    if origin is dict:
        kind = arguments[1]
        return {key: as_lists(kind, x, (*place, key), singles) for key, x in data.items()}
    if not dataclasses.is_dataclass(schema):
        return data
    hints, listed = typing.get_type_hints(schema), dict(data)
    for field in dataclasses.fields(schema):
        if field.name in data:
            item, here = data[field.name], (*place, field.name)
            if field.metadata.get("one_for_all") and _is_number(item):
                singles.append(here)
            item = _as_list(field.metadata, item)
            listed[field.name] = as_lists(hints[field.name], item, here, singles)
    return listed


def mark_singles(loaded: Any, singles: Sequence[Place]) -> None:
    """Make a :class:`OneForAll` of every number that is one for all, in place.

    Args:
        loaded: What was made of the data.
        singles: From :func:`as_lists`.
    """
    for *way, name in singles:
        owner = loaded
        for step in way:
            owner = owner[step] if isinstance(owner, (dict, list)) else getattr(owner, step)
        setattr(owner, name, OneForAll(getattr(owner, name)))


def _choice(members: tuple[Any, ...], data: Any) -> Any:
    """Member of a union that data are of: that of their tag, else the first."""
    choices = [member for member in members if member is not types.NoneType]
    tag = data.get(TAG_KEY) if isinstance(data, dict) else None
    tagged = [c for c in choices if f"!{getattr(c, '__name__', c)}" == tag]
    return (tagged or choices)[0]


def _as_list(rules: "types.MappingProxyType[Any, Any]", item: Any) -> Any:
    """One value of a field, as a list if the rules of the field's metadata make it one."""
    if item == rules.get("empty_word", ...):
        return []
    if rules.get("one_or_many") and (_is_number(item) or isinstance(item, str)):
        return [item]
    if rules.get("one_for_all") and _is_number(item):
        return [item]
    if "words" in rules and isinstance(item, list):
        return [float(entry) if _is_number(entry) else entry for entry in item]
    count, parts = rules.get("equal", 0), rules.get("parts", 1)
    if count and _is_number(item):
        return [item] * count
    if parts > 1 and isinstance(item, list) and len(item) == parts:
        return [entry for entry in item for _ in range(count // parts)]
    return item


def _is_number(item: Any) -> bool:
    """Whether something is a number, or text that is one."""
    return type(item) in (int, float, str) and is_number(item)
