"""Bounds of numbers by units, and by what fields say; single numbers and words for lists."""

import copy
import math
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
import pytest

from pfsc_drake.errors import InputError, require
from pfsc_drake.yaml.dumping import dump_typed
from pfsc_drake.yaml.fields import (
    AUTO_OR_MANY,
    NUMBERS_OR_END,
    ONE_FOR_ALL,
    OneForAll,
    equal,
    fields_of,
    spread,
)
from pfsc_drake.yaml.reading import parse_yaml
from pfsc_drake.yaml.rules import Parameters, Range
from pfsc_drake.yaml.typed import load_typed


@dataclass
class Parent(Parameters):
    """A parent.

    Attributes:
        inherited: Speed [m/s].
    """

    inherited: float = 0.0


@dataclass
class Block(Parent):
    """A block.

    Attributes:
        lengths: Two lengths
            [m].
        stiffness: Of a joint [Nm/rad or N/m], ``.inf`` for none.
        turn_deg: Angle.
        own: Own range.
        checked: Checked by itself [s], up to 2.
        share: A share of ``[N]``, of ``N`` joints.
        never: End [s].
        lowest: Least height [m].
    """

    lengths: list[float] = field(default_factory=lambda: [1.0, 2.0])
    stiffness: float = 0.0
    turn_deg: float = 0.0
    own: Annotated[float, Range(0.0, 5.0, "m")] = 0.1
    checked: float = 1.0
    share: float = 0.0
    never: float = math.inf
    lowest: float = -math.inf
    undescribed: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        require(0.0 < self.checked <= 2.0, "checked", self.checked, "above 0, at most 2 s")
        require(round(self.share) < 10, "share", self.share, "below 10")


@dataclass
class Whole:
    """A schema.

    Attributes:
        block: A block.
    """

    block: Block = field(default_factory=Block)


@pytest.mark.parametrize(
    ("name", "bounds"),
    [
        ("inherited", Range(-1e3, 1e3, "m/s")),
        ("lengths", Range(-1e4, 1e4, "m")),
        ("stiffness", Range(-1e10, 1e10, "Nm/rad or N/m", infinite=True)),
        ("turn_deg", Range(-1e5, 1e5, "deg")),
        ("own", Range(-1e4, 1e4, "m")),
        ("share", Range(-1e9, 1e9)),
        ("never", Range(-1e6, 1e6, "s", infinite=True)),
        ("lowest", Range(-math.inf, 1e4, "m")),
        ("undescribed", None),
    ],
)
def test_bounds(name, bounds):
    assert fields_of(Block)[name].bounds == bounds


def refusal_of(**data):
    with pytest.raises(InputError) as error:
        load_typed(Whole, {"block": data}, "a.yaml")
    return str(error.value)


def test_what_is_beyond_is_refused_by_its_key():
    key = "a.yaml: key 'block.lengths[1]' is -20000: expected a number from -10000 to 10000 m"
    assert refusal_of(lengths=[1.0, -2e4]) == key
    assert refusal_of(own=5.1).endswith("block.own = 5.1; allowed: 0 to 5 m")
    assert refusal_of(own=-1e-3).endswith("own = -0.001; allowed: 0 to 5 m")
    assert refusal_of(never=-math.inf).endswith("expected a number from -1e+06 to 1e+06 s, or .inf")


def test_a_block_reports_its_own_values():
    """Its own numbers only; consequences of others are ignored."""
    assert refusal_of(checked=1e300).endswith("checked = 1e+300; allowed: above 0, at most 2 s")
    assert refusal_of(share=math.inf).endswith(
        "'block.share' is inf: expected a number from -1e+09 to 1e+09"
    )
    both = refusal_of(checked=3.0, lengths=[1e5])
    assert both.endswith("'block.lengths[0]' is 100000: expected a number from -10000 to 10000 m")


def test_what_is_within_is_left_alone():
    data = {"lengths": [1e4], "stiffness": math.inf, "own": 5.0, "undescribed": 1e300}
    block = load_typed(Whole, {"block": data}, "a.yaml").block
    assert (block.lengths, block.stiffness, block.own, block.undescribed) == (
        [1e4],
        math.inf,
        5.0,
        1e300,
    )


@dataclass
class Joints:
    """Lists of as many numbers as there are joints."""

    damping: list[float] = field(default_factory=list, metadata=ONE_FOR_ALL)
    poles: list[float] = field(default_factory=list, metadata=AUTO_OR_MANY)


@dataclass
class Plain:
    """The first of a choice."""

    size: float = 1.0


@dataclass
class Sensor:
    """Lists of a fixed length, and a way."""

    noise: np.ndarray = field(default_factory=lambda: np.zeros(6), metadata=equal(6, parts=2))
    shift: list[float] = field(default_factory=lambda: [0.0] * 3, metadata=equal(3))
    points: list[float | str] = field(default_factory=lambda: [0.0, 1.0], metadata=NUMBERS_OR_END)


@dataclass
class Station:
    """All ways to hold others."""

    joints: Joints = field(default_factory=Joints)
    sensor: Plain | Sensor = field(default_factory=Plain)
    spare: Sensor | None = None
    several: list[Joints] = field(default_factory=list)
    named: dict[str, Joints] = field(default_factory=dict)


def load(text: str) -> Station:
    return load_typed(Station, parse_yaml(text, "a.yaml"), "a.yaml")


@pytest.mark.parametrize("written", ["0.5", "5e-1", "'0.5'"])
def test_one_number_for_all_is_as_many_as_are_needed(written):
    damping = load(f"joints: {{damping: {written}}}").joints.damping
    assert spread(damping, 3) == [0.5, 0.5, 0.5]
    assert spread(copy.deepcopy(damping), 2) == [0.5, 0.5]


def test_a_list_of_one_is_a_list_of_one():
    damping = load("joints: {damping: [0.5]}").joints.damping
    assert not isinstance(damping, OneForAll)
    assert spread(damping, 3) == [0.5]
    assert spread([], 3) == []


def test_it_is_found_wherever_it_stands():
    station = load(
        "several: [{}, {damping: 2}]\n"
        "named: {a: {poles: -3}, b: {poles: auto}}\n"
        "spare: {shift: 0.1}\n"
        "sensor: !Sensor {shift: 0.2, noise: 3}\n"
    )
    assert spread(station.several[1].damping, 2) == [2.0, 2.0]
    assert spread(station.named["a"].poles, 4) == [-3.0] * 4
    assert station.named["b"].poles == []
    assert station.spare.shift == [0.1] * 3
    assert station.sensor.shift == [0.2] * 3
    np.testing.assert_array_equal(station.sensor.noise, [3.0] * 6)


def test_a_number_for_each_part():
    noise = load("spare: {noise: [0.1, 0.004]}").spare.noise
    np.testing.assert_array_equal(noise, [0.1, 0.1, 0.1, 0.004, 0.004, 0.004])
    np.testing.assert_array_equal(load("spare: {noise: [1, 2, 3]}").spare.noise, [1, 2, 3])


@pytest.mark.parametrize("written", ["[0, end]", "[end, 1e-1]", "[0.5, 0]"])
def test_words_among_numbers(written):
    points = load(f"spare: {{points: {written}}}").spare.points
    assert points == [p if p == "end" else float(p) for p in parse_yaml(written, "")]
    assert {type(point) for point in points} <= {float, str}


def test_what_was_one_number_is_written_as_one():
    text = "joints: {damping: 0.5, poles: -3}\nspare: {points: [0, end]}"
    station = load(text)
    again = load_typed(Station, parse_yaml(dump_typed(station), "b"), "b")
    assert isinstance(again.joints.damping, OneForAll)
    assert again.joints == station.joints
    assert again.spare.points == [0.0, "end"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("joints: {damping: x}", "key 'joints.damping' is 'x': expected a number or a list"),
        ("joints: {damping: true}", "key 'joints.damping' is true: expected a number or a list"),
        ("joints: {poles: automatic}", "is 'automatic': expected a number, auto or a list"),
        ("spare: {noise: {}}", "key 'spare.noise' is {}: expected a number or a list of numbers"),
        (
            "spare: {points: [0, ende]}",
            "key 'spare.points[1]' is 'ende': did you mean 'end'? expected a number or end",
        ),
        ("spare: {points: [0, x]}", "key 'spare.points[1]' is 'x': expected a number or end"),
        ("spare: {points: end}", "key 'spare.points' is 'end': expected a list"),
    ],
)
def test_what_is_no_number(text, message):
    with pytest.raises(InputError) as caught:
        load(text)
    assert message in str(caught.value)
