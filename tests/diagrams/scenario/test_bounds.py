"""Every number of every block has bounds: a walk along the schema."""

import dataclasses as dc
import math
import types
import typing
import warnings

import numpy as np
import pytest

from diagrams.scenario import Scenario
from docs.making.scenario_keys import blocks
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.dumping import typed_data
from pfsc_drake.yaml.fields import fields_of, ranges_of
from pfsc_drake.yaml.typed import load_typed

OWNERS = [Scenario, *blocks()]
HOW = (
    "write its unit into the docstring, as in `margin: Least distance [m]`, whose bounds are those "
    "of pfsc_drake/yaml/fields.py, or declare bounds of its own: "
    'margin: Annotated[float, Range(least, most, "unit")]'
)


def filled(kind, default, number):
    """Return a value of a type with a number in it, None if there is no place for one."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        found = (filled(member, default, number) for member in arguments)
        return next((value for value in found if value is not None), None)
    if origin is list:
        first, *rest = default or [None]
        inner = filled(arguments[0], first, number)
        return None if inner is None else [inner, *rest]
    if origin is dict:
        inner = filled(arguments[1], None, number)
        return None if inner is None else {"a": inner}
    if kind is np.ndarray:
        return [number, 0.0, 0.0]
    return number if kind in (float, int) else None


def refusal(owner, name, number):
    """Return what is said of a number in a block of its own, None if it is accepted."""
    data, hint = typed_data(owner()), typing.get_type_hints(owner)[name]
    data[name] = filled(hint, data[name], number)
    try:
        load_typed(owner, data, "file.yaml")
    except InputError as error:
        return str(error)
    return None


def numbers_of(owner):
    hints = typing.get_type_hints(owner)
    return [f.name for f in dc.fields(owner) if filled(hints[f.name], None, 1.0) is not None]


@pytest.mark.parametrize("owner", OWNERS, ids=lambda owner: owner.__name__)
def test_every_number_is_bounded(owner):
    """On both sides, in one line that names the key; not infinite unless that means no limit."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for name in numbers_of(owner):
            entry = fields_of(owner)[name]
            ranges = [*ranges_of(entry.hint), *([entry.bounds] if entry.bounds else [])]
            infinite = any(each.infinite for each in ranges)
            for number in (1e300, -1e300, math.nan, math.inf, -math.inf):
                said = refusal(owner, name, number)
                place = f"{owner.__module__}.{owner.__name__}.{name} = {number}"
                if said is None:
                    assert number == math.inf and infinite, f"{place} is accepted: {HOW}"
                else:
                    assert name in said and "\n" not in said, f"{place}: {said}"


def test_many_numbers_are_found():
    """The walk sees what there is, in lists, unions and blocks in blocks."""
    found = {(owner.__name__, name) for owner in OWNERS for name in numbers_of(owner)}
    assert len(found) > 450
    assert {("Profile", "values"), ("WatchParameters", "margin"), ("Scenario", "duration")} <= found


def test_a_refusal_says_what_is_allowed():
    said = load_error({"obstacles": {"watch": {"margin": 1e300}}})
    assert "key 'obstacles.watch.margin' is 1e+300: expected a number from " in said
    assert said.endswith(" m")
    # what a block says itself is better
    said = load_error({"compliance": {"limits": {"settling": 1e300}}})
    assert said.endswith("settling = 1e+300; allowed: 0.02 to 1 s")


def load_error(data):
    with pytest.raises(InputError) as error:
        load_typed(Scenario, data, "file.yaml")
    return str(error.value)
