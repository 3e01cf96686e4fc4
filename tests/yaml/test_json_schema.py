"""JSON schemas: keys, choices by tags, lists that a number may replace."""

from dataclasses import dataclass, field
from typing import Annotated

import pytest
from jsonschema import Draft7Validator

from pfsc_drake.yaml.fields import AUTO_OR_MANY, NUMBERS_OR_END, REQUIRED, equal
from pfsc_drake.yaml.json_schema import json_schema, tags_of
from pfsc_drake.yaml.rules import Numbers, OneOf, Parameters, Positive, Range


@dataclass
class Line:
    """A line.

    Attributes:
        length: Length [m].
    """

    length: float = 1.0


@dataclass
class Circle:
    """A circle of :class:`~a.b.Radius`.

    Attributes:
        radius: ``R`` [m], 1e-4 to 10.
    """

    radius: Annotated[float, Range(1e-4, 10.0, "m")] = 0.1


@dataclass
class Motion(Parameters):
    """A motion.

    Attributes:
        name: Its name.
        law: ``elastic`` or ``rigid``.
        shape: Where it goes.
        others: Further ways.
        velocity: Largest velocity [m/s].
        end: When it ends [s], ``.inf`` for never.
        turn_deg: Turn.
        poles: Poles [1/s].
        shift: Shift [m].
        points: Places [m].
        gains: By name.
        last: A line that may be left out.
    """

    name: str = field(default="", metadata=REQUIRED)
    law: Annotated[str, OneOf(("elastic", "rigid"))] = "rigid"
    shape: Line | Circle = field(default_factory=Line)
    others: list[Line | Circle] = field(default_factory=list)
    velocity: Positive = 0.1
    end: float = 2.0
    turn_deg: float = 0.0
    poles: list[float] = field(default_factory=list, metadata=AUTO_OR_MANY)
    shift: Annotated[list[float], Numbers(3)] = field(
        default_factory=lambda: [0.0, 0.0, 0.0], metadata=equal(3)
    )
    points: list[float | str] = field(default_factory=list, metadata=NUMBERS_OR_END)
    gains: dict[str, Line] = field(default_factory=dict)
    last: Line | None = None


SCHEMA = json_schema(Motion, "Motions")
KEYS = SCHEMA["properties"]


def test_the_schema_of_keys() -> None:
    assert SCHEMA["required"] == ["name"]
    assert KEYS["law"] == {
        "description": "elastic or rigid.",
        "type": "string",
        "enum": ["elastic", "rigid"],
        "default": "rigid",
    }
    assert KEYS["velocity"] == {
        "description": "Largest velocity [m/s].",
        "type": "number",
        "exclusiveMinimum": 0.0,
        "maximum": 1e3,
        "default": 0.1,
    }
    assert "maximum" not in KEYS["end"]
    assert KEYS["turn_deg"]["description"] == "Turn. [deg]"
    assert KEYS["poles"]["default"] == "auto"
    assert SCHEMA["definitions"]["Circle"]["description"] == "A circle of Radius."
    assert SCHEMA["definitions"]["Circle"]["properties"]["radius"] == {
        "description": "R [m], 1e-4 to 10.",
        "type": "number",
        "minimum": 1e-4,
        "maximum": 10.0,
        "default": 0.1,
    }


def test_tags() -> None:
    assert tags_of(Motion) == ["!Circle", "!Line"]
    assert [choice["title"] for choice in KEYS["shape"]["anyOf"]] == ["!Line", "!Circle"]


@pytest.mark.parametrize(
    ("key", "valid", "invalid"),
    [
        ("shape", [{"length": 2}, {"radius": 0.2}, {}], [{"radius": 20}, {"size": 1}, None, 3]),
        ("others", [[], [{"length": 1}, {"radius": 1}]], [[{"x": 1}], {}]),
        ("poles", ["auto", -3, [-3, -4]], ["x", ["auto"], True]),
        ("shift", [1, [1, 2, 3]], [[1, 2], "x", [1, 2, "x"], 1e9]),
        ("points", [[0, "end"]], [["start"], "end"]),
        ("gains", [{"one": {}}], [{"one": 3}, []]),
        ("last", [None, {}], [{"a": 1}]),
        ("end", [3, 1e6], [-1e7, "never"]),
        ("_anchor", [3, {"a": 1}], []),
    ],
)
def test_values(key: str, valid: list[object], invalid: list[object]) -> None:
    validator = Draft7Validator(SCHEMA)
    for value in valid:
        assert validator.is_valid({"name": "a", key: value}), value
    for value in invalid:
        assert not validator.is_valid({"name": "a", key: value}), value


def test_two_blocks_of_one_name_are_a_fault_of_the_program() -> None:
    other = dataclass(type("Line", (), {"__annotations__": {}, "__doc__": "Another."}))

    @dataclass
    class Both:
        """Both."""

        one: Line = field(default_factory=Line)
        two: other = field(default_factory=other)  # type: ignore[valid-type]

    with pytest.raises(ValueError, match="have one name"):
        json_schema(Both, "")
