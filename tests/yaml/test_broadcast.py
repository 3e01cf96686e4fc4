"""Single numbers and words where a schema has a list."""

import copy
from dataclasses import dataclass, field

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.yaml.fields import (
    AUTO_OR_MANY,
    NUMBERS_OR_END,
    ONE_FOR_ALL,
    OneForAll,
    equal,
    spread,
)
from pfsc_drake.yaml.reading import parse_yaml
from pfsc_drake.yaml.typed import dump_typed, load_typed


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
