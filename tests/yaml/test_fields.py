"""Bounds of numbers by units, and by what fields say; single numbers and words for lists."""

import math
from dataclasses import dataclass, field
from typing import Annotated

import pytest

from pfsc_drake.errors import InputError, require
from pfsc_drake.yaml.fields import fields_of
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
    untold: float = 0.0

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
        ("own", None),
        ("share", Range(-1e9, 1e9)),
        ("never", Range(-1e6, 1e6, "s", infinite=True)),
        ("lowest", Range(-math.inf, 1e4, "m")),
        ("untold", None),
    ],
)
def test_bounds(name, bounds):
    assert fields_of(Block)[name].bounds == bounds


def said_of(**data):
    with pytest.raises(InputError) as error:
        load_typed(Whole, {"block": data}, "a.yaml")
    return str(error.value)


def test_what_is_beyond_is_refused_by_its_key():
    key = "a.yaml: key 'block.lengths[1]' is -20000: expected a number from -10000 to 10000 m"
    assert said_of(lengths=[1.0, -2e4]) == key
    assert said_of(own=5.1).endswith("key 'block': own = 5.1; allowed: 0 to 5 m")
    assert said_of(own=-1e-3).endswith("own = -0.001; allowed: 0 to 5 m")
    assert said_of(never=-math.inf).endswith("expected a number from -1e+06 to 1e+06 s, or .inf")


def test_what_a_block_says_itself_is_said():
    """Of its own numbers; what others lead to is not."""
    assert said_of(checked=1e300).endswith("checked = 1e+300; allowed: above 0, at most 2 s")
    assert said_of(share=math.inf).endswith(
        "'block.share' is inf: expected a number from -1e+09 to 1e+09"
    )
    both = said_of(checked=3.0, lengths=[1e5])
    assert both.endswith("'block.lengths[0]' is 100000: expected a number from -10000 to 10000 m")


def test_what_is_within_is_left_alone():
    data = {"lengths": [1e4], "stiffness": math.inf, "own": 5.0, "untold": 1e300}
    block = load_typed(Whole, {"block": data}, "a.yaml").block
    assert (block.lengths, block.stiffness, block.own, block.untold) == (
        [1e4],
        math.inf,
        5.0,
        1e300,
    )
