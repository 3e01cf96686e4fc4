"""Rules of fields: what they allow, what they say, in Python and from a file."""

import math
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
import pytest

from pfsc_drake.errors import InputError, require
from pfsc_drake.yaml.rules import (
    Count,
    Finite,
    NotNegative,
    Numbers,
    OneOf,
    Parameters,
    Positive,
    Positives,
    Range,
    Rule,
)
from pfsc_drake.yaml.typed import load_typed

INF, NAN = math.inf, math.nan


@pytest.mark.parametrize(
    ("rule", "words", "allowed", "refused"),
    [
        (Range(), "a finite number", [-1e9, 0, 3], [INF, -INF, NAN, "x", None, [1.0]]),
        (Range(0.0, open=True), "a positive number", [1e-9], [0.0, INF, NAN]),
        (Range(0.0), "zero or a positive number", [0.0, 5], [-1e-9, INF]),
        (Range(0.0, infinite=True), "zero or a positive number, or .inf", [0.0, INF], [-1, NAN]),
        (Range(2.0), "2 or more", [2], [1.9]),
        (Range(2.0, open=True), "above 2", [2.1], [2.0]),
        (Range(most=3.0), "at most 3", [-1e9, 3], [3.1, -INF]),
        (Range(1.0, 2.0, "m"), "1 to 2 m", [1, 2], [0.9, 2.1]),
        (Range(0.0, 1.0, open=True), "above 0, at most 1", [1], [0]),
        (Range(0.0, 1.0, below=True), "0 to below 1", [0], [1]),
        (Range(0.0, 1.0, open=True, below=True), "above 0, below 1", [0.5], [0, 1]),
        (Range(1, 2, "s", besides=0), "0, or 1 to 2 s", [0, 1], [0.5, -1]),
        (Range(1, 2, besides=-1), "-1, or 1 to 2", [-1, 2], [0]),
        (Numbers(2), "2 finite numbers", [[1, 2], np.ones(2)], [[1], [1, INF], np.eye(2), 3, "ab"]),
        (
            Numbers(3, Range(-2, 2, "m"), empty=True),
            "empty, or 3 finite numbers of at most 2 m",
            [[], [1, -2, 2]],
            [[0, 0, 3], [1]],
        ),
        (Numbers(3, some=True), "3 numbers, not all zero", [[0, 0, 1]], [[0, 0, 0], [0, 0, NAN]]),
        (Numbers(each=Range(0.0)), "finite numbers, none negative", [[], [0, 1]], [[-1], [INF]]),
        (Numbers(each=Range(0.0, 5.0)), "finite numbers, none negative, at most 5", [[5]], [[6]]),
        (Numbers(each=Range(0.0, open=True), fewest=1), "positive numbers", [[1]], [[], [0]]),
        (Numbers(each=Range(1, 2, "m")), "numbers from 1 to 2 m", [[1.5]], [[3]]),
        (Count(2), "2 or more", [[1, 2], "ab"], [[1]]),
        (Count(1, 2), "1 to 2", [[1]], [[], [1, 2, 3]]),
        (Count(2, empty=True, words="pairs, or none"), "pairs, or none", [[], [1, 2]], [[1]]),
    ],
)
def test_allowed_values_and_their_words(rule: Rule, words: str, allowed, refused) -> None:
    assert str(rule) == words
    for value in allowed:
        rule.check("key", value)
    for value in refused:
        with pytest.raises(InputError, match=r"^key = .*; allowed: ") as caught:
            rule.check("key", value)
        assert str(caught.value).endswith(words)


def test_the_nearest_word_is_named() -> None:
    with pytest.raises(InputError, match=r"law = elatic; allowed: elastic, rigid; did you mean "):
        OneOf(("elastic", "rigid")).check("law", "elatic")


@dataclass
class Tank(Parameters):
    """Rules, and a check across fields."""

    capacity: Positive = 4.0
    initial: NotNegative = 0.5
    kind: Annotated[str, OneOf(("soft", "hard"))] = "soft"
    limit: Positive | None = None
    ends: Annotated[list[Annotated[list[float], Numbers(2)]], Count(1)] = field(
        default_factory=lambda: [[0.0, 1.0]]
    )
    joints: dict[str, Finite] = field(default_factory=dict)
    points: list[Annotated[float, Range(0.0, 1.0)] | str] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.initial <= self.capacity, "initial", self.initial, "capacity or less")


@dataclass
class LargeTank(Tank):
    """Rules of its own beside those that it inherits."""

    weights: Positives = field(default_factory=list)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"capacity": -1.0}, "capacity = -1.0; allowed: a positive number"),
        ({"capacity": "much"}, "capacity = much; allowed: a positive number"),
        ({"kind": "sof"}, "kind = sof; allowed: soft, hard; did you mean 'soft'"),
        ({"limit": 0.0}, "limit = 0.0; allowed: a positive number"),
        ({"ends": []}, r"ends = \[\]; allowed: 1 or more"),
        ({"ends": [[0.0, 1.0], [2.0]]}, r"ends\[1\] = \[2.0\]; allowed: 2 finite numbers"),
        ({"joints": {"one": INF}}, "joints.one = inf; allowed: a finite number"),
        ({"points": ["end", 2.0]}, r"points\[1\] = 2.0; allowed: 0 to 1"),
        ({"initial": 5.0}, "initial = 5.0; allowed: capacity or less"),
        ({"weights": [1.0, 0.0]}, r"weights = \[1.0, 0.0\]; allowed: positive numbers"),
    ],
)
def test_refused_at_creation(changes, message) -> None:
    with pytest.raises(InputError, match=f"^{message}"):
        LargeTank(**changes)
    if changes != {"capacity": "much"}:
        with pytest.raises(InputError, match=f"^a.yaml: (.*1. )?{message}"):
            load_typed(LargeTank, changes, "a.yaml")


def test_allowed_at_creation() -> None:
    tank = LargeTank(1.0, 1.0, "hard", None, [[0.0, 2.0]], {"one": 1.0}, [0.5, "end"], [2.0])
    assert (tank.limit, tank.points, tank.weights) == (None, [0.5, "end"], [2.0])


def test_rules_of_other_fields_are_checked_beside_a_misfit() -> None:
    with pytest.raises(InputError) as caught:
        load_typed(Tank, {"capcity": 1.0, "kind": "x", "initial": 9.0}, "a.yaml")
    message = str(caught.value)
    assert message.startswith("a.yaml: 2 things are wrong: (1) unknown key 'capcity'")
    assert message.endswith("(2) kind = x; allowed: soft, hard")
