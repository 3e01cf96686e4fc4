"""Reading of YAML: tags and private keys, wrong files in one line, and writing as the inverse."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.common.yaml import yaml_load_data

from pfsc_drake import InputError
from pfsc_drake.yaml.reading import dump_yaml, parse_yaml, read_yaml

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
        ("a: &x [*x]\n", "contains itself"),
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
    with pytest.raises(InputError, match="cannot be read: Is a directory"):
        read_yaml(tmp_path)
    (tmp_path / "latin.yaml").write_bytes(b"a: \xff\xfe\n")
    with pytest.raises(InputError, match="not UTF-8 text"):
        read_yaml(tmp_path / "latin.yaml")


SCALARS = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text()
KEYS = st.text(min_size=1, max_size=5).filter(lambda key: key not in ("_tag", "<<", "="))


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


def test_order_of_keys_is_kept():
    assert list(parse_yaml(dump_yaml({"z": 1, "a": {"y": 1, "b": 2}}), "")["a"]) == ["y", "b"]
    assert list(parse_yaml(dump_yaml({"z": 1, "a": 2}), "")) == ["z", "a"]
