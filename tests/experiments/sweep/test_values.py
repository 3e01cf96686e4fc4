"""What stands behind --vary KEY=."""

import math
import string

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from experiments.sweep.values import (
    Random,
    column_value,
    number_text,
    parse_values,
    split_values,
)
from pfsc_drake import InputError
from pfsc_drake.yaml.reading import parse_yaml

SOURCE = "--vary key=..."


def drawn(text, count=4000):
    """Numbers of a random distribution."""
    values = parse_values(text, SOURCE)
    assert isinstance(values, Random)
    generator = np.random.default_rng(1)
    return np.array([float(values.sample(generator)) for _ in range(count)])


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("0.9,1, 1.1", [0.9, 1, 1.1]),
        ("elastic,rigid", ["elastic", "rigid"]),
        ("[1, 2],[3,4]", [[1, 2], [3, 4]]),
        ("{a: 1, b: [2, 3]},null", [{"a": 1, "b": [2, 3]}, None]),
        ("!Circle {radius: 1},!Line {}", [{"_tag": "!Circle", "radius": 1}, {"_tag": "!Line"}]),
        ("'a, b',\"c]\"", ["a, b", "c]"]),
        ("it's,fine", ["it's", "fine"]),
        ("12:30,x", [750, "x"]),  # as YAML reads it
        ("linspace(0, 1, 5)", [0.0, 0.25, 0.5, 0.75, 1.0]),
        ("linspace(1, -1, 3)", [1.0, 0.0, -1.0]),
        ("geomspace(1, 100, 3)", [1.0, 10.0, 100.0]),
        ("range(3)", [0, 1, 2]),
        ("range(2, 5)", [2, 3, 4]),
    ],
)
def test_grids(text, values):
    grid = parse_values(text, SOURCE)
    assert isinstance(grid, tuple)
    assert [parse_yaml(value, "") for value in grid] == values


@pytest.mark.parametrize(
    ("text", "distribution"),
    [
        ("0.9:1.1", stats.uniform(0.9, 0.2)),
        (" -1 : 1 ", stats.uniform(-1.0, 2.0)),
        ("uniform(2, 4)", stats.uniform(2.0, 2.0)),
        ("loguniform(1e-6, 1)", stats.loguniform(1e-6, 1.0)),
        ("normal(1, 0.05)", stats.norm(1.0, 0.05)),
    ],
)
def test_distributions(text, distribution):
    assert stats.kstest(drawn(text), distribution.cdf).pvalue > 0.01


def test_whole_numbers_and_choices():
    numbers, counts = np.unique(drawn("integers(1, 6)"), return_counts=True)
    assert numbers.tolist() == [1, 2, 3, 4, 5, 6]
    assert stats.chisquare(counts).pvalue > 0.01
    choice = parse_values("choice(elastic, [1, 2])", SOURCE)
    generator = np.random.default_rng(2)
    texts = [choice.sample(generator) for _ in range(400)]
    assert set(texts) == {"elastic", "[1, 2]"}
    assert 150 < texts.count("elastic") < 250


def test_a_list_of_independent_draws():
    values = parse_values("normal(1, 0.05)*3", SOURCE)
    generator = np.random.default_rng(3)
    draws = np.array([parse_yaml(values.sample(generator), "") for _ in range(2000)])
    assert draws.shape == (2000, 3)
    assert np.abs(np.corrcoef(draws.T) - np.eye(3)).max() < 0.1
    assert draws.std(axis=0) == pytest.approx(0.05, rel=0.1)
    assert len(parse_yaml(parse_values("0:1 * 2", SOURCE).sample(generator), "")) == 2


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("3", "one value varies nothing"),
        ("", "an empty value"),
        ("1,,2", "an empty value"),
        ("[1,2", "[ is not closed"),
        ("1,2]", "] closes nothing"),
        ("(1]", "] closes nothing"),
        ("'a,b", "' is not closed"),
        ("gauss(0, 1)", "unknown gauss(...)"),
        ("normal(1)", "1 numbers; allowed: normal(mean, sd)"),
        ("normal(1, x)", "x is not a finite number"),
        ("normal(1, 0)", "sd = 0; allowed: > 0"),
        ("2:1", "2 to 1; allowed: low < high"),
        ("0:.inf", "one value"),
        ("uniform(0, inf)", "inf is not a finite number"),
        ("loguniform(0, 1)", "low > 0"),
        ("integers(1.5, 2)", "1.5 is no whole number"),
        ("integers(2, 2)", "first < last"),
        ("choice(a)", "one value varies nothing"),
        ("linspace(0, 1, 1)", "1 values; allowed: two or more"),
        ("linspace(0, 1, 1e9)", "1000000000 values; allowed: up to"),
        ("geomspace(-1, 1, 3)", "allowed: both > 0"),
        ("range(1)", "1 values; allowed: two or more"),
        ("normal(1, 2)*0", "*0; allowed: a list of 1 to"),
        ("normal(1, 2)*999999999999", "allowed: a list of 1 to"),
        ("!!int a,b", "invalid YAML"),
    ],
)
def test_what_is_wrong_is_named(text, reason):
    with pytest.raises(InputError) as caught:
        parse_values(text, SOURCE)
    assert str(caught.value).startswith(SOURCE)
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_keep_their_bits(value):
    read = parse_yaml(number_text(value), "")
    assert isinstance(read, float)
    assert math.copysign(1.0, read) == math.copysign(1.0, value)
    assert read == value
    assert column_value(number_text(value)) == value


@given(st.lists(st.text(string.ascii_letters + "0.[]{}()'\", :!", max_size=6), max_size=4))
def test_any_text_is_read_or_refused(pieces):
    text = ",".join(pieces)
    try:
        values = parse_values(text, SOURCE)
    except InputError:
        return
    if isinstance(values, tuple):
        assert ",".join(split_values(text, SOURCE)) or "(" in text
        assert len(values) >= 2
    else:
        values.sample(np.random.default_rng(0))


def test_columns_show_numbers_or_texts():
    assert column_value("3") == 3
    assert column_value("1e-3") == 1e-3
    assert column_value("true") == "true"
    assert column_value("[1, 2]") == "[1, 2]"
    assert column_value("elastic") == "elastic"
