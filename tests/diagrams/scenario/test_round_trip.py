"""A scenario that is written and read again is the same."""

import dataclasses
import types
import typing
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from diagrams.scenario import Scenario
from experiments.scenario_file import read_scenario, scenario_names
from pfsc_drake.control.compliance.impedance_parameters import CoordinateImpedance, Profile
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.dumping import dump_typed
from pfsc_drake.yaml.reading import parse_yaml
from pfsc_drake.yaml.typed import load_typed

Variant = tuple[type, str, Any]

# what else a member needs of the block that it stands in
_NEEDED: dict[str, dict[str, Any]] = {
    "press": {"transversal": CoordinateImpedance(stiffness=Profile(0.0))}
}


def _same(left: Any, right: Any) -> bool:
    """Whether two values are of the same types, and equal."""
    if type(left) is not type(right):
        return False
    if dataclasses.is_dataclass(left):
        names = [field.name for field in dataclasses.fields(left)]
        return all(_same(getattr(left, name), getattr(right, name)) for name in names)
    if isinstance(left, np.ndarray):
        return np.array_equal(left, right) and left.dtype == right.dtype
    if isinstance(left, list):
        return len(left) == len(right) and all(map(_same, left, right))
    if isinstance(left, dict):
        return left.keys() == right.keys() and all(_same(left[k], right[k]) for k in left)
    return bool(left == right)


def _again(value: Any) -> Any:
    return load_typed(type(value), parse_yaml(dump_typed(value), "dumped"), "dumped")


def _schemas(schema: Any, seen: set[type]) -> Iterator[type]:
    """All dataclasses that a schema is made of."""
    if dataclasses.is_dataclass(schema) and isinstance(schema, type) and schema not in seen:
        seen.add(schema)
        yield schema
        for hint in typing.get_type_hints(schema).values():
            yield from _schemas(hint, seen)
    for argument in typing.get_args(schema):
        yield from _schemas(argument, seen)


def _is_union(schema: Any) -> bool:
    return typing.get_origin(schema) in (typing.Union, types.UnionType)


def _variants() -> Iterator[Variant]:
    """Every member of every union: where it is declared, the key, the member."""
    for owner in _schemas(Scenario, set()):
        for key, hint in typing.get_type_hints(owner).items():
            union = typing.get_args(hint)[0] if typing.get_origin(hint) is list else hint
            if _is_union(union):
                yield from ((owner, key, member) for member in typing.get_args(union))


def _unusual(member: Any) -> Any:
    """A value of a member that differs from the default in as much as is allowed."""
    if not dataclasses.is_dataclass(member):
        return {bool: False, float: 123.456, str: "end", type(None): None}[member]
    value = member()
    for field in dataclasses.fields(member):
        old = getattr(value, field.name)
        if type(old) in (bool, float, int):
            new: Any = not old if type(old) is bool else type(old)(1.25 * old + 1)
        elif isinstance(old, list) and old and type(old[0]) is float:
            new = [1.25 * item for item in old]
        else:
            continue
        try:
            value = dataclasses.replace(value, **{field.name: new})
        except InputError:
            continue
    return value


def _named(variant: Variant) -> str:
    owner, key, member = variant
    return f"{owner.__name__}.{key}-{member.__name__}"


def test_unions_are_found() -> None:
    found = {_named(variant) for variant in _variants()}
    assert {"RegionParameters.shape-Paraboloid", "Intersection.surfaces-Extruded"} < found
    assert {"Shift.way-Swinging", "Scenario.drive_friction-bool"} < found


@pytest.mark.parametrize("variant", list(_variants()), ids=_named)
def test_each_member_of_each_union_is_read_as_it_was_written(variant: Variant) -> None:
    owner, key, member = variant
    value = _unusual(member)
    several = isinstance(getattr(owner(), key), list)
    needed = _NEEDED.get(key, {})
    default = value if member is str else member()  # no word is no default
    given = dataclasses.replace(owner(), **{key: [value, default] if several else value}, **needed)
    again = _again(given)
    assert _same(again, given)


@pytest.mark.parametrize("name", scenario_names())
def test_each_shipped_scenario_is_read_as_it_was_written(name: str) -> None:
    settings = load_typed(Scenario, read_scenario(name, []).data, name)
    again = _again(settings)
    assert _same(again, settings)
