"""Metrics: targets, file, display."""

import json
import math

import pytest

from pfsc_drake import InputError
from reporting.metrics import NARROW_SPACE, Metric, Metrics, format_cell, format_quantity


@pytest.mark.parametrize(
    ("value", "target", "passed"),
    [
        (0.04e-3, "< 0.05e-3", True),
        (0.05e-3, "< 0.05e-3", False),
        (0.05e-3, "<= 0.05e-3", True),
        (5.0, ">=5", True),
        (5.0, "> 5", False),
        (4.9, ">= 5", False),
        (math.nan, "< 1", False),
        (math.nan, "> 1", False),
        (1.0, "below 20 mm", None),
        (1.0, "< one", None),
        (1.0, None, None),
    ],
)
def test_passed(value, target, passed):
    assert Metric(value, "m", target).passed is passed


def test_file_is_flat_and_strict_json(tmp_path):
    metrics = Metrics()
    metrics.add("settling_time", math.nan, "s")
    metrics.add("ratio", math.inf, "1")
    metrics.add("max_path_deviation", 4e-5, "m", "< 0.05e-3", "Sec. 3.8.3")
    metrics.write(tmp_path / "metrics.json")

    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} is not JSON")

    text = (tmp_path / "metrics.json").read_text()
    assert json.loads(text, parse_constant=refuse) == {
        "settling_time": {"value": None, "unit": "s"},
        "ratio": {"value": None, "unit": "1"},
        "max_path_deviation": {
            "value": 4e-5,
            "unit": "m",
            "target": "< 0.05e-3",
            "source": "Sec. 3.8.3",
        },
    }
    back = Metrics.read(tmp_path / "metrics.json")
    assert back["max_path_deviation"] == metrics["max_path_deviation"]
    assert math.isnan(back["settling_time"].value)
    assert list(back) == list(metrics)


@pytest.mark.parametrize("text", ["{", "[1]", '{"a": 3}', '{"a": {"unit": "m"}}'])
def test_unreadable_file_is_an_input_error(tmp_path, text):
    path = tmp_path / "metrics.json"
    path.write_text(text)
    with pytest.raises(InputError, match=r"metrics\.json"):
        Metrics.read(path)


def test_set_target():
    metrics = Metrics()
    metrics.add("peak_speed", 1.4, "m/s", source="log")
    metrics.set_target("peak_speed", "<= 1.5")
    assert metrics["peak_speed"] == Metric(1.4, "m/s", "<= 1.5", "log")
    with pytest.raises(InputError, match="'peak_sped'; known: peak_speed"):
        metrics.set_target("peak_sped", "<= 1.5")


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (4.32e-5, "m", "43.2 µm"),
        (0.1e-3, "m", "100 µm"),
        (0.9999999e-3, "m", "1 mm"),
        (-0.0123456, "m", "-12.35 mm"),
        (12.0, "m", "12 m"),
        (3e-12, "m", "0.003 nm"),
        (2.99e-16, "m", "0 m"),
        (-2.58e-29, "rad/m", "0 rad/m"),
        (2e-9, "rad/m", "2.00·10⁻⁹ rad/m"),
        (3e-10, "Nm", "0 N\u2009m"),
        (1.5e-4, "rad", "150 µrad"),
        (46.2, "us", "46.2 µs"),
        (775.26, "Nm", "775.3 N\u2009m"),
        (0.02, "Nm", "0.02 N\u2009m"),
        (7.3128, "1", "7.313"),
        (0.0, "m", "0 m"),
        (3.2e-7, "1", "3.20·10⁻⁷"),
        (-1.3e-17, "1", "0"),
        (4e-16, "kg", "0 kg"),
        (-5e-14, "N m", "0 N\u2009m"),
        (math.nan, "m", "\u2013"),
    ],
)
def test_format_quantity(value, unit, text):
    assert format_quantity(value, unit).replace(NARROW_SPACE, " ") == text


def test_numbers_of_tables_are_without_rounding_errors():
    assert [format_cell(x) for x in (1.23456, -2e-7, -1.3e-17, 0)] == ["1.235", "-2e-07", "0", "0"]
