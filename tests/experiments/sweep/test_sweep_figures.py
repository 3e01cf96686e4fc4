"""Pictures of a sweep, drawn from a table that no run has made."""

import struct

import numpy as np
import pytest

from experiments.sweep.definition import draw_samples, parse_variations
from experiments.sweep.summary import measure_spreads, table_columns
from experiments.sweep.sweep_figures import MAX_PANELS, draw_sweep
from experiments.sweep.worker import RunRow
from reporting.style import DPI, WIDTH


def drawn(samples, rows, metric="max_path_deviation"):
    varied = list(samples[0].varied)
    return draw_sweep(measure_spreads(rows)[metric], table_columns(samples, rows), varied)


def check(figure):
    assert figure.png.startswith(b"\x89PNG")
    assert struct.unpack(">I", figure.png[16:20])[0] == round(WIDTH * DPI)


@pytest.mark.slow(but="options0")
@pytest.mark.parametrize(
    "options",
    [
        ["mass=0:1"],
        ["mass=loguniform(1e-3, 1e3)", "law=choice(elastic, rigid)", "n=integers(1, 3)"],
        [f"mass=normal(1, 0.1)*{MAX_PANELS + 2}"],
    ],
)
def test_parameters_of_all_kinds(rows, options):
    samples = draw_samples(parse_variations(options), 6, 0)
    parameters, histogram = drawn(samples, rows)
    check(parameters)
    check(histogram)
    assert (parameters.name, histogram.name) == ("parameters", "histogram")
    assert "Ring: the worst, run 2." in parameters.caption
    assert "Crosses at the top" in parameters.caption
    assert "4 runs that completed. 2 did not" in histogram.caption
    assert ("2 more parameters are in the table" in parameters.caption) == ("*" in options[0])


@pytest.mark.slow
def test_a_single_run_and_equal_values(rows):
    samples = draw_samples(parse_variations(["mass=0:1"]), 1, 0)
    for figure in drawn(samples, {0: rows[0]}):
        check(figure)
    samples = draw_samples(parse_variations(["mass=0:1"]), 4, 0)
    for figure in drawn(samples, dict.fromkeys(range(4), rows[0])):
        check(figure)


@pytest.mark.slow
def test_values_over_decades(rows):
    samples = draw_samples(parse_variations(["mass=0:1"]), 40, 0)
    spread = {}
    for i, value in enumerate(np.geomspace(1e-7, 1e-1, 40)):
        metrics = type(rows[0].metrics)()
        metrics.add("max_path_deviation", value, "m")
        spread[i] = RunRow("completed", "", metrics)
    for figure in drawn(samples, spread):
        check(figure)


def test_where_a_metric_is_least_is_told(rows):
    """A correlation near zero hides it."""
    samples = draw_samples(parse_variations(["mass=-2,-1,0,1,2"]), None, 0)
    made = {}
    for i, sample in enumerate(samples):
        metrics = type(rows[0].metrics)()
        metrics.add("max_path_deviation", 1e-3 + abs(sample.varied["mass"]) * 1e-3, "m")
        made[i] = RunRow("completed", "", metrics)
    parameters, _ = drawn(samples, made)
    check(parameters)
    assert "least near 0 of mass" in parameters.caption
