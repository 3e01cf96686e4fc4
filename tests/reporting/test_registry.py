"""The registry of signals, metrics and figures: consistent, and as the documentation has it."""

import re

import pytest

from experiments.results.features import FEATURES
from reporting.metrics import Metrics
from reporting.provenance import PROJECT_ROOT
from reporting.registry import (
    FIGURES,
    METRICS,
    SIGNALS,
    KnownSignal,
    as_data,
    as_markdown,
    as_text,
    find_metric,
    possible_metrics,
)

# properties of a run that are no signals
PROPERTIES = {
    *("path", "curved_path", "path_of_points", "path_orientation"),
    *("surface", "curved_surface", "fitted_surface"),
    *("limited_joints", "plan", "redundant", "closed"),
}


def test_the_documentation_is_up_to_date():
    """Write it anew with ``make signals``."""
    page = PROJECT_ROOT / "docs" / "reference" / "signals.md"
    assert page.read_text(encoding="utf-8") == as_markdown()


def test_what_metrics_and_figures_need_is_known():
    needed = {need for row in (*METRICS.values(), *FIGURES.values()) for need in row.needs}
    assert needed <= set(SIGNALS) | PROPERTIES


def test_signals_name_figures_and_figures_signals():
    for signal in SIGNALS.values():
        assert set(signal.figures) <= set(FIGURES), signal.name
    for figure in FIGURES.values():
        needed = set(figure.needs) - PROPERTIES
        drawn = [name for name in needed if figure.name in SIGNALS[name].figures]
        assert drawn or not needed, figure.name


def test_every_figure_is_drawn_by_one_feature():
    drawn = [name for feature in FEATURES for name in feature.figures]
    assert len(drawn) == len(set(drawn))
    assert set(FIGURES) - set(drawn) == {"path", "surface_fit"}


def test_every_row_says_what_it_is():
    for row in (*SIGNALS.values(), *METRICS.values(), *FIGURES.values()):
        assert re.fullmatch(r"[A-Z].*[^.]", row.text), row.name
        assert "|" not in row.text


@pytest.mark.parametrize(
    ("turning", "unit"),
    [([True, True], "Nm"), ([False, False], "N"), ([True, False], "Nm or N")],
)
def test_units_follow_the_joints(turning, unit):
    assert SIGNALS["tau_d"].unit_of(turning) == unit
    assert SIGNALS["eta"].unit_of(turning) == "m"


@pytest.mark.parametrize(
    ("labels", "count", "expected"),
    [
        ("", 1, ["name"]),
        ("", 2, ["name_1", "name_2"]),
        ("p_{}", 1, ["p_1"]),
        ("p_{}", 2, ["p_1", "p_2"]),
        ("x y", 2, ["x", "y"]),
    ],
)
def test_labels(labels, count, expected):
    assert KnownSignal("name", "m", "Text", labels=labels).labels_of(count) == expected


def test_metrics_of_each_drive():
    assert find_metric("peak_torque_12") is METRICS["peak_torque_{}"]
    assert find_metric("controller_tick_us_p99") is METRICS["controller_tick_us_p99"]
    assert find_metric("peak_torque") is None
    names = possible_metrics({"tau_d", "path_length"}, 2)
    assert names[:4] == ["peak_torque_1", "peak_torque_2", "saturated_samples", "saturated_share"]
    assert "path_length" in names
    assert "path_smallest_radius" not in names
    assert "settling_time" not in names
    assert "real_time_factor" in names


def test_metrics_take_units_and_sources_from_the_registry():
    metrics = Metrics()
    metrics.add("distances_per_tick", 3.0)
    metrics.add("peak_torque_2", 3.0, "N")
    assert (metrics["distances_per_tick"].unit, metrics["distances_per_tick"].source) == (
        "1",
        "mean",
    )
    assert metrics["peak_torque_2"].unit == "N"
    with pytest.raises(KeyError, match="no such metric 'whatever'"):
        metrics.add("whatever", 1.0)


def test_as_text_and_as_data():
    text, data = as_text(), as_data()
    assert "y_t " in text
    assert not re.search(r" +$", text, re.MULTILINE)
    assert [row["name"] for row in data["signals"]] == list(SIGNALS)
    assert data["metrics"][0]["needs"] == ("xi",)
