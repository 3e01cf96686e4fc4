"""Messages name the file and the line of the key that they begin with."""

from dataclasses import dataclass, field

import pytest

from pfsc_drake.checks import require, require_positive
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.reading import read_with_lines
from pfsc_drake.yaml.source import Source, join_keys, override_location
from pfsc_drake.yaml.typed import load_file

TEXT = """\
# a comment, and a private root key
_gains: &gains
  eta: [1.0, 2.0]
  xi: 3.0

name: x
controller:
  law: elastic
  first: *gains
  second:
    <<: *gains
    xi: 4.0
points: [[1, 2],
         [3, 4]]
path: !Circle
  radius: 1.0
1: one
"""


@pytest.fixture
def lines(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text(TEXT, encoding="utf-8")
    return read_with_lines(path)[1]


@pytest.mark.parametrize(
    ("key", "line"),
    [
        ("name", 6),
        ("controller", 7),
        ("controller.law", 8),
        # an alias has the lines of its anchor, but for keys that are written at its own place
        ("controller.first", 9),
        ("controller.first.eta", 3),
        ("controller.first.eta[1]", 3),
        ("controller.second", 10),
        ("controller.second.eta", 3),
        ("controller.second.xi", 12),
        ("points", 13),
        ("points[0][1]", 13),
        ("points[1]", 14),
        ("points[1][0]", 14),
        ("path.radius", 16),
        ("1", 17),
    ],
)
def test_lines_of_keys(lines, key, line):
    assert lines[key] == line


def test_private_root_keys_have_no_line(lines):
    assert not any(key.startswith("_") for key in lines)


def test_lines_of_an_empty_file_are_not_needed(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text("{}\n", encoding="utf-8")
    assert read_with_lines(path) == ({}, {})


SOURCE = Source(
    "a.yaml",
    {
        "path": 3,
        "path.shape": 4,
        "path.shape.points": 5,
        "path.shape.points[1]": 6,
        "path.shape.points[10]": 7,
        "duration": "--set duration=long",
    },
    {"/in/points.csv": "path.shape.points[1]"},
)


@pytest.mark.parametrize(
    ("problem", "message"),
    [
        ("path.shape = 1; allowed: 2", "a.yaml:4: path.shape = 1; allowed: 2"),
        ("path.shape.points[1] = 0", "a.yaml:6: path.shape.points[1] = 0"),
        ("path.shape.points[10] = 0", "a.yaml:7: path.shape.points[10] = 0"),
        # what is not written has the line of the mapping or list around it
        ("path.shape.points[11] = 0", "a.yaml:5: path.shape.points[11] = 0"),
        ("path.shape.shapes = 0", "a.yaml:4: path.shape.shapes = 0"),
        ("path.shapes = 0", "a.yaml:3: path.shapes = 0"),
        ("key 'path.shape' is 3: expected", "a.yaml:4: key 'path.shape' is 3: expected"),
        ("unknown key 'path.shap' = 3", "a.yaml:3: unknown key 'path.shap' = 3"),
        ("missing key 'path.shape.x'", "a.yaml:4: missing key 'path.shape.x'"),
        ("path: no end", "a.yaml:3: path: no end"),
        ("duration = long", "a.yaml: --set duration=long: duration = long"),
        # a longer word, and a message without a key
        ("paths = 3", "a.yaml: paths = 3"),
        ("path_length = 3", "a.yaml: path_length = 3"),
        ("", "a.yaml: "),
        # files have the key of their name
        (
            "/in/points.csv: line 3: no number",
            "a.yaml:6: path.shape.points[1]: /in/points.csv: line 3: no number",
        ),
        (
            "cannot read /in/points.csv: no such file",
            "a.yaml:6: path.shape.points[1]: cannot read /in/points.csv: no such file",
        ),
        ("/in/points.csv2: no such file", "a.yaml: /in/points.csv2: no such file"),
    ],
)
def test_one_problem_has_its_line_behind_the_name(problem, message):
    assert str(SOURCE.refusal([problem])) == message


def test_each_of_several_problems_has_its_line():
    assert str(SOURCE.refusal(["path.shape = 1", "duration = long", "else"])) == (
        "a.yaml: 3 things are wrong: (1) line 4: path.shape = 1; "
        "(2) --set duration=long: duration = long; (3) else"
    )


def test_a_source_without_lines_is_named():
    assert str(Source("a.yaml").refusal(["path = 1"])) == "a.yaml: path = 1"


def test_an_override_replaces_everything_below_its_key():
    locations = {"a": 1, "a.b": 2, "a.b.c": 3, "a.b[1]": 4, "a.bc": 5}
    override_location(locations, "a.b", "--set a.b=0")
    assert locations == {"a": 1, "a.b": "--set a.b=0", "a.bc": 5}


def test_an_override_stands_for_the_mappings_that_it_creates():
    locations = {"a": 1}
    override_location(locations, "a.b.c", "--set a.b.c=0")
    assert locations == {"a": 1, "a.b": "--set a.b.c=0", "a.b.c": "--set a.b.c=0"}


def test_key_paths():
    assert join_keys(("a", "b", 1, 0, "c")) == "a.b[1][0].c"


@dataclass
class Inner:
    """A rule of one key, and one across keys."""

    radius: float = 1.0
    depth: float = 2.0

    def __post_init__(self) -> None:
        require_positive("radius", self.radius)
        require(self.depth >= self.radius, "depth", self.depth, "radius or more")
        require(self.depth < 1e3, "the sum", self.depth, "less")


@dataclass
class Outer:
    """Blocks at all places."""

    inner: Inner = field(default_factory=Inner)
    others: list[Inner] = field(default_factory=list)
    named: dict[str, Inner] = field(default_factory=dict)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("\ninner: {radius: -1}", ":2: inner.radius = -1.0; allowed: a positive number"),
        ("inner:\n  radius: x\n", ":2: key 'inner.radius' is 'x': expected a number"),
        ("inner:\n  radus: 1\n", ":2: unknown key 'inner.radus' = 1: did you mean 'radius'?"),
        ("inner: {}\nothers: 3\n", ":2: key 'others' is 3: expected a list"),
        ("others:\n- {}\n- depth: 0\n", ":3: others[1].depth = 0.0; allowed: radius or more"),
        ("named:\n  a:\n    depth: 0\n", ":3: named.a.depth = 0.0; allowed: radius or more"),
        # depth is the default's
        ("inner:\n  radius: 3\n", ":1: inner.depth = 2.0; allowed: radius or more"),
        # of no key
        ("others:\n-\n  depth: 5e+3\n", ":3: others[0]: the sum = 5000.0; allowed: less"),
    ],
)
def test_refused_values_of_a_file(tmp_path, text, message):
    path = tmp_path / "a.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_file(Outer, path)
    assert str(caught.value).startswith(f"{path}{message}")


def test_several_refused_values_of_a_file(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text("inner:\n  radius: -1\nothers:\n- depth: 0\n", encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_file(Outer, path)
    assert str(caught.value) == (
        f"{path}: 2 things are wrong: (1) line 2: inner.radius = -1.0; allowed: a positive number; "
        "(2) line 4: others[0].depth = 0.0; allowed: radius or more"
    )
