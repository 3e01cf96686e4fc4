"""All errors of a file are reported together, in one line; nothing else is."""

from dataclasses import dataclass, field

import pytest

from pfsc_drake.errors import MAX_MESSAGE, InputError, require, require_one_of, require_positive
from pfsc_drake.yaml.reading import parse_yaml
from pfsc_drake.yaml.typed import load_typed

LAWS = ("elastic", "rigid")


@dataclass
class Notch:
    """Checks across keys."""

    radius: float = 0.02
    depth: float = 0.03

    def __post_init__(self) -> None:
        require_positive("radius", self.radius)
        require(self.radius < 1.0, "radius", self.radius, "less than 1 m")
        require(self.depth >= self.radius, "depth", self.depth, "radius or more")


@dataclass
class Controller:
    """A word, and a number calculated with it."""

    law: str = "elastic"
    period: float = 1e-3

    def __post_init__(self) -> None:
        require_one_of("law", self.law, LAWS)
        order = {"elastic": 4, "rigid": 2}[self.law]
        require_positive("period", self.period / order)


@dataclass
class Scenario:
    """A check of the whole."""

    controller: Controller = field(default_factory=Controller)
    notch: Notch = field(default_factory=Notch)
    others: list[Notch] = field(default_factory=list)
    duration: float = 1.0

    def __post_init__(self) -> None:
        long = self.duration >= 10.0 * self.controller.period
        require(long, "duration", self.duration, "10 periods or more")


def refusal(text: str) -> str:
    with pytest.raises(InputError) as caught:
        load_typed(Scenario, parse_yaml(text, "a.yaml"), "a.yaml")
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith("a.yaml: ")
    assert len(message) <= MAX_MESSAGE
    return message.removeprefix("a.yaml: ")


def test_one_thing_needs_no_number():
    assert refusal("duration: long") == "key 'duration' is 'long': expected a number"
    assert refusal("notch: {radius: -1}") == ("notch.radius = -1.0; allowed: a positive number")


def test_keys_types_and_values_of_several_blocks():
    assert refusal("{duratoin: 2, notch: {depth: x}, controller: {law: elatic}}") == (
        "3 things are wrong: "
        "(1) unknown key 'duratoin' = 2: did you mean 'duration'?"
        " allowed: controller, notch, others, duration; "
        "(2) key 'notch.depth' is 'x': expected a number; "
        "(3) controller.law = elatic; allowed: elastic, rigid; did you mean 'elastic'?"
    )


def test_several_values_of_one_block():
    assert refusal("notch: {radius: 2, depth: -1}") == (
        "2 things are wrong: "
        "(1) notch.radius = 2.0; allowed: less than 1 m; "
        "(2) notch.depth = -1.0; allowed: radius or more"
    )


def test_every_item_of_a_list():
    message = refusal("others: [{radius: -1}, {}, {radius: 3}]")
    assert "(1) others[0].radius = -1.0;" in message
    assert "(2) others[2].radius = 3.0;" in message


def test_a_key_is_named_once():
    assert refusal("notch: {radius: -1, depth: -2}").count("radius =") == 1


def test_what_contains_something_wrong_is_not_judged():
    # with the default's radius this depth would be refused
    assert refusal("notch: {radus: 0.001, depth: 0.01}") == (
        "unknown key 'notch.radus' = 0.001: did you mean 'radius'? allowed: radius, depth"
    )
    # nor is the whole, whose check would compare with a period that is none
    assert refusal("{controller: {period: 0}, duration: -1}") == (
        "controller.period = 0.0; allowed: a positive number"
    )


def test_consequences_of_a_refused_value_are_not_reported():
    # the law has no order
    assert "KeyError" not in refusal("controller: {law: magic}")
    assert refusal("controller: {law: magic, period: -1}").count("law = magic") == 1


def test_many_are_counted():
    message = refusal("{" + ", ".join(f"{key * 9}: 1" for key in "abcdefghijklmnopqr") + "}")
    assert message.startswith("18 things are wrong: (1) unknown key 'aaaaaaaaa'")
    shown = message.count("unknown key")
    assert message.endswith(f"; and {18 - shown} more")
    assert shown >= 4


def test_the_nearest_word_stays_where_space_is_scarce():
    wrong = ["duratoin: 1", "controler: {}", "nocth: {}", "othres: []", "a: 1", "b: 1", "c: 1"]
    message = refusal("{" + ", ".join(wrong) + "}")
    for word in ("duration", "controller", "notch", "others"):
        assert f"did you mean '{word}'?" in message


def test_no_exception_of_a_check_itself_is_swallowed():
    @dataclass
    class Broken:
        value: float = 1.0

        def __post_init__(self) -> None:
            if self.value != 1.0:
                raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        load_typed(Broken, {"value": 2.0}, "a.yaml")
