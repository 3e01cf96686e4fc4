"""Reading of YAML: tags and private keys, wrong files in one line, and writing as the inverse."""

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.common.yaml import yaml_load_data

from pfsc_drake import InputError
from pfsc_drake.yaml.reading import MAX_BYTES, dump_yaml, parse_yaml, read_yaml

TEXT = """\
_template: &gains {a: 1, b: [1.0, 2.0]}
path: !Lemniscate {size: 0.25, inner: [!Circle {}]}
first: *gains
second: {<<: *gains, a: 2}
1: 1e-3
"""


def test_tags_survive_and_private_keys_do_not(tmp_path):
    path = tmp_path / "made_up.yaml"
    path.write_text(TEXT, encoding="utf-8")
    data = read_yaml(path)
    assert data["path"] == {"_tag": "!Lemniscate", "size": 0.25, "inner": [{"_tag": "!Circle"}]}
    assert "_template" not in data
    assert data["second"] == {"a": 2, "b": [1.0, 2.0]}
    assert data["first"]["b"] is not data["second"]["b"]
    assert data[1] == "1e-3"  # YAML 1.1


def test_data_is_what_drake_reads():
    assert parse_yaml(TEXT, "made up") == yaml_load_data(TEXT, private=True)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: [", "invalid YAML in line 1"),
        ("a: 1\nb:\n  c: 1\n  d: 2\n  c: 3\n", "key 'c' appears a second time in line 5"),
        ("", "the root is empty; allowed: a mapping"),
        ("- 1\n", "the root is a list; allowed: a mapping"),
        ("words", "the root is a str; allowed: a mapping"),
        ("a: 1\npath: !Circle 3\n", "invalid YAML in line 2: a !Tag needs a mapping"),
        ("path: !Circle [3]\n", "invalid YAML in line 1: a !Tag needs a mapping"),
        ("a: &x [*x]\n", "line 1: an alias (*name) contains itself"),
        ("a: &x\n  b: {c: *x}\n", "contains itself"),
        ("a: " + "[" * 101 + "]" * 101, "line 1: nested too deeply; allowed: up to 100 levels"),
        ("[" * 25_000, "line 1: nested too deeply; allowed: up to 100 levels"),
        ("\na: " + "1:" * 200_000 + "1", "line 2: a number of 400001 characters"),
        ("a: " + "1:" * 50 + "1.5", "a number of 103 characters; allowed: up to 100"),
        ("a: " + "[" * 3000 + "]" * 3000, "nested too deeply; allowed: up to 100 levels"),
        ('a: 1\nb: "x\\0y"\n', "line 2: 'x\\x00y' holds a NUL"),
        ('"\\ud800": 1\n', "line 1: '\\ud800' holds a NUL or half a character"),
        ("a: 1\n---\nb: 2\n", "invalid YAML in line 2"),
        ("a: \x07\n", "invalid YAML"),
        ("a: 2020-02-31\n", "invalid YAML: day is out of range"),
        ("a: !!bool x\n", "invalid YAML"),
        ("a: !!timestamp x\n", "invalid YAML"),
    ],
)
def test_broken_files(tmp_path, text, message):
    path = tmp_path / "broken.yaml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_yaml(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_unreadable_files(tmp_path):
    with pytest.raises(InputError, match="cannot be read: No such file"):
        read_yaml(tmp_path / "none.yaml")
    with pytest.raises(InputError, match="cannot be read: is a folder; allowed: a file"):
        read_yaml(tmp_path)
    (tmp_path / "latin.yaml").write_bytes(b"a: \xff\xfe\n")
    with pytest.raises(InputError, match="not UTF-8 text"):
        read_yaml(tmp_path / "latin.yaml")


TEXTS = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"))
SCALARS = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | TEXTS
KEYS = TEXTS.filter(lambda key: 0 < len(key) <= 5).filter(
    lambda key: key not in ("_tag", "<<", "=")
)


@given(
    st.recursive(
        SCALARS,
        lambda inner: (
            st.lists(inner, max_size=3)
            | st.dictionaries(KEYS, inner, max_size=3)
            | st.dictionaries(KEYS, inner, max_size=3).map(lambda d: {**d, "_tag": "!Some"})
        ),
        max_leaves=10,
    )
)
def test_writing_undoes_reading(data):
    read = parse_yaml(dump_yaml(data), "dumped")
    assert read == data
    assert repr(dump_yaml(read)) == repr(dump_yaml(data))


def test_order_of_keys_is_preserved():
    assert list(parse_yaml(dump_yaml({"z": 1, "a": {"y": 1, "b": 2}}), "")["a"]) == ["y", "b"]
    assert list(parse_yaml(dump_yaml({"z": 1, "a": 2}), "")) == ["z", "a"]


def test_the_deepest_nesting_is_read_and_written():
    """The root is the first level, and the number inside the last."""
    text = "a: " + "[" * 98 + "1" + "]" * 98
    data = parse_yaml(text, "deep")
    assert parse_yaml(dump_yaml(data), "written") == data


def multiplying(levels, tenfold="[{}]"):
    """A document of a few lines that holds 10^levels copies of one number."""
    lines = ["_0: &a0 [1]"]
    for level in range(1, levels + 1):
        copies = ", ".join([f"*a{level - 1}"] * 10)
        lines.append(f"_{level}: &a{level} {tenfold.format(copies)}")
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("levels", [5, 9, 30])
@pytest.mark.parametrize("tenfold", ["[{}]", "{{inside: [{}]}}", "!Some {{inside: [{}]}}"])
def test_aliases_that_multiply_are_refused_before_they_are_copied(levels, tenfold):
    with pytest.raises(InputError, match=r"with aliases .* allowed: up to 100000") as caught:
        parse_yaml(multiplying(levels, tenfold), "many.yaml")
    assert str(caught.value).startswith("many.yaml: line ")
    assert len(str(caught.value)) < 200


def test_merged_mappings_that_multiply_are_refused():
    lines = ["_0: &a0 {k: 1}"]
    for level in range(1, 12):
        copies = ", ".join([f"*a{level - 1}"] * 10)
        lines.append(f"_{level}: &a{level} {{<<: [{copies}]}}")
    with pytest.raises(InputError, match="allowed: up to 100000"):
        parse_yaml("\n".join(lines), "many.yaml")


def test_aliases_that_multiply_a_little_are_copied():
    assert len(parse_yaml(multiplying(4), "some.yaml")["_4"]) == 10


def test_no_pipe_and_no_device_is_opened(tmp_path):
    os.mkfifo(tmp_path / "pipe.yaml")
    for path in (tmp_path / "pipe.yaml", Path("/dev/zero")):
        with pytest.raises(InputError, match=r"is a pipe, socket or device; allowed: a file"):
            read_yaml(path)


def test_size_is_bounded(tmp_path):
    path = tmp_path / "large.yaml"
    comment = "# " + "x" * 97 + "\n"
    path.write_text("a: 1\n" + comment * (MAX_BYTES // len(comment)))
    with pytest.raises(InputError, match=f"100000[0-9]+ bytes; allowed: up to {MAX_BYTES}"):
        read_yaml(path)
    path.write_text("a: 1\n" + comment * (MAX_BYTES // len(comment) - 1))
    assert read_yaml(path) == {"a": 1}


@pytest.mark.parametrize("name", ["n" * 300, "a\0b", "n" * 5000])
def test_names_that_no_file_can_have(tmp_path, name):
    with pytest.raises(InputError, match="cannot be read") as caught:
        read_yaml(tmp_path / name)
    assert "\0" not in str(caught.value)


FRAGMENTS = st.sampled_from(
    [
        "a: ",
        "- ",
        "{",
        "}",
        "[",
        "]",
        "&x ",
        "*x",
        "!T ",
        "!!int ",
        "!!float ",
        "!!binary ",
        "<<: *x",
        "\n",
        "\n  ",
        ": ",
        "'",
        '"',
        "> ",
        "? ",
        "#",
        "1_0",
        "0x1F",
        "1:30",
        "2020-02-31",
        "~",
        ".nan",
        "=",
        "%",
    ]
)


@pytest.mark.slow
@given(st.lists(FRAGMENTS | st.text(max_size=3), max_size=30).map("".join))
def test_every_text_is_data_or_one_line(text):
    try:
        data = parse_yaml(text, "made_up.yaml")
    except InputError as error:
        message = str(error)
        assert message.startswith("made_up.yaml: ")
        assert "\n" not in message
    else:
        dump_yaml(data)


@given(st.binary(max_size=100))
def test_every_file_is_data_or_one_line(tmp_path_factory, content):
    path = tmp_path_factory.getbasetemp() / "any.yaml"
    path.write_bytes(content)
    try:
        assert isinstance(read_yaml(path), dict)
    except InputError as error:
        assert str(error).startswith(f"{path}: ")
