"""What a person, a program or an accident may make of a scenario, a table or a text."""

import copy
from collections.abc import Iterator
from typing import Any

from hypothesis import strategies as st

from diagrams.scenario import Scenario
from experiments.scenario_file import read_scenario
from pfsc_drake.yaml.dumping import typed_data
from pfsc_drake.yaml.reading import TAG_KEY
from pfsc_drake.yaml.typed import load_typed

Place = tuple[str | int, ...]

NUMBERS = [
    *(0, 1, -1, 2, 7, 100, 100_000, 2**31, 2**63, 10**400, -(10**400)),
    *(0.5, -0.0, 1e-300, 5e-324, 1e-12, 1e-9, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 3.0),
    *(10.0, 1e3, 1e4, 1e6, 1e9, 1e12, 1e16, 1e100, 1e154, 1e155, 1e300, 1.7e308),
    *(float("inf"), float("-inf"), float("nan")),
]
TEXTS = [
    *("", " ", "~", "abc", "1_0", "0x10", "1e-3", "1e400", "nan", "inf", ".inf", "true", "null"),
    *("none", "known", "measured", "rigid", "elastic", "singular_perturbation", "velocity_servo"),
    *("path", "trajectory", "world", "manifold", "zyz", "runge_kutta2", "implicit_euler"),
    *("auto", "comau_racer_1_4", "comau_racer_1_4_3r", "festo_expt_45", "weld_tool", "joint_1"),
    *("..", "/", "/dev/null", "nowhere.csv", "nowhere.sdf", "package://a/b", "paths"),
    *("٣", "\uff58", "ä\u0301", "\u202e", "a\nb", "a\x1b[31mb", "x" * 300, "x" * 100_000),
]
OTHERS: list[Any] = [None, True, False, [], {}, [[]], [None], [[[1.0]]], {"a": 1}, {TAG_KEY: "!A"}]
FACTORS = [0.0, -1.0, 1e-12, 1e-6, 1e-3, 0.1, 0.5, 0.999, 1.001, 2.0, 10.0, 1e3, 1e6, 1e12]


def full_scenario(name: str, *overrides: str) -> dict[str, Any]:
    """Return a shipped scenario with all keys of its schema, defaults included."""
    file = read_scenario(name, list(overrides))
    settings = load_typed(Scenario, file.data, name)
    return typed_data(settings)


def places(data: Any, here: Place = ()) -> Iterator[Place]:
    """Return where every value in a scenario is, inner nodes too."""
    if here:
        yield here
    if isinstance(data, (dict, list)):
        for key, value in data.items() if isinstance(data, dict) else enumerate(data):
            if key != TAG_KEY:
                yield from places(value, (*here, key))


def _get(data: Any, place: Place) -> Any:
    for key in place:
        data = data[key]
    return data


@st.composite
def _changed_value(draw: st.DrawFn, value: Any) -> Any:
    """Draw something for a value: often of its own kind, sometimes of any."""
    anything = st.sampled_from([*NUMBERS, *TEXTS, *OTHERS])
    if isinstance(value, bool):
        own = st.just(not value)
    elif isinstance(value, (int, float)):
        own = st.sampled_from(NUMBERS) | st.sampled_from([value * f for f in FACTORS])
    elif isinstance(value, str):
        own = st.sampled_from(TEXTS)
    elif isinstance(value, list):
        own_lists = [value[:1], value[:-1], value + value[-1:], value[::-1], [value], value * 40]
        own = st.sampled_from(own_lists) | st.sampled_from(NUMBERS).map(lambda n: [n] * len(value))
    elif isinstance(value, dict):
        own = st.sampled_from([dict(list(value.items())[:-1]), {**value, "x" * 50: 1}, {}])
    else:
        own = anything  # null
    return copy.deepcopy(draw(own if draw(st.integers(0, 3)) else anything))


@st.composite
def edits(draw: st.DrawFn, data: dict[str, Any]) -> list[tuple[Place, Any]]:
    """Draw one to three changes of a scenario: places and what stands there instead."""
    # by subject first, so that long lists do not draw most of the changes
    by_block: dict[str | int, list[Place]] = {}
    for place in places(data):
        by_block.setdefault(place[0], []).append(place)
    changes = []
    for _ in range(draw(st.sampled_from([1, 1, 1, 2, 3]))):
        place = draw(st.sampled_from(by_block[draw(st.sampled_from(list(by_block)))]))
        changes.append((place, draw(_changed_value(_get(data, place)))))
    return changes


def edited(data: dict[str, Any], changes: list[tuple[Place, Any]]) -> dict[str, Any]:
    """Return a scenario with changes; one inside what an earlier one took away is left out."""
    data = copy.deepcopy(data)
    for place, value in changes:
        try:
            _get(data, place[:-1])[place[-1]] = value
        except (LookupError, TypeError):
            continue
    return data


_KINDS = ["cell", "number", "row", "drop", "double", "header", "all", "few", "encode"]


@st.composite
def tables(draw: st.DrawFn, text: str) -> bytes:
    """Draw a CSV file with something changed in it."""
    lines = text.splitlines()
    separator, end, encoding = ",", "\n", "utf-8"
    for _ in range(draw(st.sampled_from([1, 1, 2, 3]))):
        row = draw(st.integers(0, len(lines) - 1)) if lines else 0
        cells = lines[row].split(",") if lines else [""]
        column = draw(st.integers(0, len(cells) - 1))
        kind = draw(st.sampled_from(_KINDS))
        if kind == "cell":
            cells[column] = draw(st.sampled_from([*TEXTS, '"', "1,5", "#", "x", "zyx_1", "\0"]))
        elif kind == "number":
            cells[column] = str(draw(st.sampled_from([n for n in NUMBERS if abs(n) < 10**300])))
        elif kind == "row":
            cells = draw(st.sampled_from([[""], cells[:-1], cells + cells[:1], cells[::-1]]))
        elif kind == "header" and lines:
            names = lines[0].split(",")
            names[draw(st.integers(0, len(names) - 1))] = draw(
                st.sampled_from(["", "x", "y", "qw", "zyx_1", "zyx_deg_1", "zyz_1", "r11", "X "])
            )
            lines[0] = ",".join(names)
        elif kind == "all":
            factor = draw(st.sampled_from([*FACTORS, 1e100, 1e300]))
            lines = [",".join(_scaled(cell, factor) for cell in line.split(",")) for line in lines]
        elif kind == "few":
            lines = lines[: draw(st.integers(0, 6))]
        elif kind == "encode":
            encoding = draw(st.sampled_from(["utf-16", "utf-8-sig", "latin-1", "utf-32"]))
            end = draw(st.sampled_from(["\n", "\r\n", "\r", "\n\n"]))
            separator = draw(st.sampled_from([",", ";", "\t", " "]))
        if lines and kind in ("cell", "number", "row"):
            lines[row] = ",".join(cells)
        elif lines and kind == "drop":
            row = min(row, len(lines) - 1)
            del lines[row]
        elif lines and kind == "double":
            lines.insert(row, lines[row])
    text = end.join(line.replace(",", separator) for line in lines)
    return text.encode(encoding, "replace")


def _scaled(cell: str, factor: float) -> str:
    try:
        return repr(float(cell) * factor)
    except ValueError:
        return cell
