"""Figures: drawn where the log has the signals, at a readable size, not empty."""

from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from diagrams.scenario import Scenario
from experiments.results.features import FEATURES, draw_figures, render_figures
from experiments.results.run_log import RunLog
from reporting.registry import find_metric

PATH = np.stack([np.linspace(0.0, 0.3, 50), np.zeros(50), np.full(50, 0.5)], axis=1)


NAMES = [
    "path",
    "progress",
    "transversal",
    "orientation",
    "angles",
    "virtual_input",
    "forces",
    "positions",
    "velocities",
    "drive_torques",
    "friction",
    "deflection",
]


def names(log):
    return [drawing.name for drawing in draw_figures(log, [PATH])]


@pytest.mark.slow
def test_all_figures_are_drawn(drawn_log):
    figures = render_figures(drawn_log, [PATH])
    assert [figure.name for figure in figures] == NAMES
    for figure in figures:
        assert figure.title
        assert figure.caption.endswith(".")
        with Image.open(BytesIO(figure.png)) as image:
            width, height = image.size
            pixels = np.asarray(image.convert("L"))
        assert width == 1800
        assert 500 <= height <= 2600
        assert pixels.std() > 5.0  # not an empty sheet


@pytest.mark.parametrize(
    ("signals", "expected"),
    [
        ([], []),
        (["y_t"], ["path"]),
        (["eta"], ["progress"]),
        (["xi", "q_M"], ["transversal"]),
        (["v_J", "tau_d"], ["velocities", "drive_torques"]),
        (["tau_f"], []),
        (["tau_f", "v_J"], ["velocities", "friction"]),
        (["angles_e"], []),
        (["angles_e", "angles_d"], ["angles"]),
        (["axis_e"], []),
        (["axis_e", "axis_d"], ["axis"]),
        (["virtual_input"], []),
        (["phi", "virtual_input"], ["orientation", "virtual_input"]),
        (["manifold_force"], ["forces"]),
        (["wrench_ext"], ["forces"]),
        (["tared", "sensor_fault"], []),
    ],
)
def test_missing_signals_are_skipped(drawn_log, signals, expected):
    for name in ("axis_e", "axis_d"):
        drawn_log.add(name, np.tile([0.0, 0.6, 0.8], (201, 1)), "1", ["x", "y", "z"])
    drawn_log.signals = {name: drawn_log[name] for name in signals}
    assert names(drawn_log) == expected


def test_no_forces_no_figure(drawn_log):
    drawn_log.signals = {"wrench_ext": drawn_log["wrench_ext"]}
    drawn_log["wrench_ext"].values[:] = 0.0
    assert names(drawn_log) == []


@pytest.mark.slow
@pytest.mark.usefixtures("coarse")
def test_a_run_stopped_by_nan_can_still_be_drawn(drawn_log):
    for signal in drawn_log.signals.values():
        if signal.values.dtype.kind == "f":
            signal.values[150:] = np.nan
    assert len(render_figures(drawn_log, [PATH])) == len(NAMES)


@pytest.mark.slow
@pytest.mark.usefixtures("coarse")
def test_a_log_of_one_sample_can_be_drawn(drawn_log):
    for signal in drawn_log.signals.values():
        signal.values = signal.values[100:101]
    drawn_log.time = drawn_log.time[100:101]
    assert len(render_figures(drawn_log, [PATH])) == len(NAMES)


def test_a_log_without_samples_has_no_figures():
    log = RunLog(np.zeros(0))
    log.add("eta", np.zeros((0, 1)), "m")
    assert names(log) == []


def test_requirements_are_of_known_metrics():
    for feature in FEATURES:
        for name in (*feature.requirements(Scenario()), *feature.always):
            assert find_metric(name) is not None, name
