"""Figures: written where the log has the signals, at a readable size, and showing the data."""

import numpy as np
import pytest
from PIL import Image

from experiments.figure_path import draw_path
from experiments.figures import draw_progress, draw_torques, draw_transversal, write_figures
from experiments.run_log import RunLog

PATH = np.stack([np.linspace(0.0, 0.3, 50), np.zeros(50), np.full(50, 0.5)], axis=1)


def full_log() -> RunLog:
    time = np.linspace(0.0, 1.0, 201)
    log = RunLog(time)
    log.add("y_t", np.stack([0.3 * time, 0.01 * np.exp(-9 * time), 0 * time + 0.5], axis=1), "m")
    log.add("eta", 0.3 * time, "m")
    log.add("eta_p", 0.3 * time + 1e-3, "m")
    log.add("eta_dot", np.full(201, 0.3), "m/s")
    log.add("xi", np.stack([0.01 * np.exp(-9 * time), 0 * time], axis=1), "m")
    log.add("phi", np.outer(np.exp(-time), [1e-3, 2e-3, 3e-3]), "rad")
    for name, unit in (("q_J", "rad"), ("q_M", "rad"), ("v_J", "rad/s"), ("v_M", "rad/s")):
        log.add(name, np.outer(time, np.arange(6.0)), unit)
    log.add("tau_d", np.outer(np.sin(9 * time), np.arange(1.0, 7.0)), "Nm", limits=5.0)
    return log


def test_all_figures_are_written(tmp_path):
    figures = write_figures(full_log(), PATH, tmp_path / "figures")
    names = [figure.path.stem for figure in figures]
    assert names == [
        "path",
        "progress",
        "transversal",
        "orientation",
        "velocities",
        "torques",
        "deflection",
    ]
    for figure in figures:
        assert figure.title
        assert figure.caption
        with Image.open(figure.path) as image:
            width, height = image.size
            pixels = np.asarray(image.convert("L"))
        assert width == 1800
        assert 500 <= height <= 2000
        assert pixels.std() > 5.0  # not an empty sheet


@pytest.mark.parametrize(
    ("signals", "expected"),
    [
        ([], []),
        (["y_t"], ["path"]),
        (["eta"], ["progress"]),
        (["xi", "q_M"], ["transversal"]),
        (["v_J", "tau_d"], ["velocities", "torques"]),
    ],
)
def test_missing_signals_are_skipped(tmp_path, signals, expected):
    log = full_log()
    log.signals = {name: log[name] for name in signals}
    assert [figure.path.stem for figure in write_figures(log, PATH, tmp_path)] == expected
    assert sorted(path.stem for path in tmp_path.iterdir()) == sorted(expected)


def test_a_run_stopped_by_nan_can_still_be_drawn(tmp_path):
    log = full_log()
    for signal in log.signals.values():
        signal.values[150:] = np.nan
    assert len(write_figures(log, PATH, tmp_path)) == 7


def test_a_log_of_one_sample_can_be_drawn(tmp_path):
    log = full_log()
    for signal in log.signals.values():
        signal.values = signal.values[:1]
    log.time = log.time[:1]
    assert len(write_figures(log, PATH, tmp_path)) == 7


def test_path_has_equal_scales_and_both_ends():
    axes = draw_path(full_log(), PATH).axes[0]
    limits = np.array([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])
    aspect = np.asarray(axes.get_box_aspect())
    scale = aspect / (limits[:, 1] - limits[:, 0])
    np.testing.assert_allclose(scale, scale[0], rtol=1e-9)
    ends = {line.get_label(): np.array(line.get_data_3d())[:, 0] for line in axes.lines}
    np.testing.assert_allclose(ends["start"], [0.0, 0.01, 0.5])
    np.testing.assert_allclose(ends["end"], full_log()["y_t"].values[-1])


def test_progress_shows_the_error_in_millimetres():
    panels = draw_progress(full_log()).axes
    np.testing.assert_allclose(panels[1].lines[0].get_ydata(), -1.0, atol=1e-9)
    assert "mm" in panels[1].get_ylabel()


def test_transversal_is_enlarged_after_convergence():
    panels = draw_transversal(full_log()).axes
    low, high = panels[1].get_ylim()
    late = 10.0 * np.exp(-9 * 0.25)  # mm, where the last three quarters begin
    assert (low, high) == pytest.approx((-1.2 * late, 1.2 * late))
    assert panels[2].get_yscale() == "log"


def test_only_torque_limits_within_reach_are_drawn():
    panels = draw_torques(full_log()).axes
    dashed = [
        [line.get_ydata()[0] for line in panel.lines if line.get_linestyle() == "--"]
        for panel in panels
    ]
    # Axis 3 of 1, 2, 3 Nm is the only one beyond half of 5 Nm in the first panel.
    assert dashed == [[-5.0, 5.0], [-5.0, 5.0] * 3]
