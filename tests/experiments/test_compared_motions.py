"""Whether scenarios ask for the same motion."""

import pytest

from experiments.compared_motions import motion_differences

BASE = """
name: a
robot: {model: r}
path: {shape: !Circle {radius: 0.1}, orientation: {task: full}}
surface: null
reference: {points: [0.0, 0.5], velocity: 0.2}
controller: {law: rigid}
duration: 5.0
"""


def against(old, new):
    assert old in BASE
    return motion_differences({"a": BASE, "b": BASE.replace(old, new)})


@pytest.mark.parametrize(
    ("old", "new"),
    [("", ""), ("law: rigid", "law: elastic"), ("model: r", "model: s"), ("name: a", "name: b")],
)
def test_what_is_compared_is_no_other_motion(old, new):
    assert against(old, new) == []


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("velocity: 0.2", "velocity: 1.0", "reference.velocity is 0.2 in a, 1 in b"),
        ("[0.0, 0.5]", "[0.0, 0.7]", "reference.points is [0.0, 0.5] in a, [0.0, 0.7] in b"),
        ("radius: 0.1", "radius: 0.2", "path.shape.radius is 0.1 in a, 0.2 in b"),
        ("!Circle {radius: 0.1}", "!Line {}", "path.shape is !Circle in a, !Line in b"),
        ("surface: null", "surface: {kind: x}", "surface is not given in a, another one in b"),
        ("duration: 5.0", "duration: 9.0", "duration is 5 in a, 9 in b"),
        (
            "!Circle {radius: 0.1}",
            "{file: /somewhere/way.csv}",
            "path.shape is !Circle in a, way.csv in b",
        ),
        ("[0.0, 0.5]", "[{at: 0.0}]", "reference.points is [0.0, 0.5] in a, 1 entry in b"),
    ],
)
def test_another_motion_is_told_with_its_key(old, new, told):
    assert against(old, new) == [told]


def test_runs_of_one_value_are_told_together():
    texts = dict.fromkeys(("a", "c"), BASE) | {"b": BASE.replace("0.2", "1.0")}
    assert motion_differences(texts) == ["reference.velocity is 0.2 in a and c, 1 in b"]


def test_of_many_differences_a_few_are_named():
    keys = "".join(f", k{i}: {{}}" for i in range(9))
    (text,) = [BASE.replace("velocity: 0.2", f"velocity: 0.2{keys.format(*range(9))}")]
    found = motion_differences({"a": BASE, "b": text})
    assert len(found) == 5
    assert found[-1] == "5 more keys"


def test_files_are_compared_by_what_they_hold(tmp_path):
    def text(folder, content):
        (tmp_path / folder).mkdir()
        file = tmp_path / folder / "way.csv"
        file.write_text(content)
        return f"path: {{shape: {{file: {file}}}}}"

    a, b, c = text("a", "1, 2"), text("b", "1, 2"), text("c", "3, 4")
    assert motion_differences({"a": a, "b": b}) == []
    assert motion_differences({"a": a, "c": c}) == [
        "path.shape.file is way.csv, but not the same content"
    ]
    # gone: by their names
    (tmp_path / "a" / "way.csv").unlink()
    assert motion_differences({"a": a, "c": c}) == []


def test_what_cannot_be_read_tells_nothing():
    assert motion_differences({"a": BASE, "b": "{", "c": "- 1"}) == []
    assert motion_differences({}) == []
