"""The ball in the cross-section of its notch, drawn from a made-up log."""

import numpy as np
import pytest

from experiments.figures.all import draw_figures
from experiments.figures.notch import draw_notch_position
from experiments.results.run_log import RunLog


@pytest.fixture(name="log")
def fixture_log():
    log = RunLog(np.linspace(0.0, 1.0, 5))
    log.add(
        "notch_position",
        [[0, 0], [1e-3, 0], [2e-3, -1e-3], [np.nan, np.nan], [-3e-3, 1e-3]],
        "m",
        ["left", "above"],
        2e-3,
    )
    return log


def test_left_is_left(log):
    (panel,) = draw_notch_position(log).canvas.axes
    way = panel.lines[0]
    np.testing.assert_allclose(way.get_xdata(), [0.0, -1.0, -2.0, np.nan, 3.0])
    np.testing.assert_allclose(way.get_ydata(), [0.0, 0.0, -1.0, np.nan, 1.0])
    assert "mm" in panel.get_xlabel() and "mm" in panel.get_ylabel()


def test_free_circle_and_all_of_the_way_are_in_the_picture(log):
    (panel,) = draw_notch_position(log).canvas.axes
    circle = next(line for line in panel.lines if line.get_label() == "free of contact")
    np.testing.assert_allclose(np.hypot(circle.get_xdata(), circle.get_ydata()), 2.0)
    low, high = panel.get_xlim()
    assert low < -3.0 and high > 3.0 and panel.get_ylim() == (low, high)


def test_is_drawn_when_logged(log):
    log.add("y_t", np.zeros((5, 3)), "m")
    assert "notch" in [drawing.name for drawing in draw_figures(log, [np.zeros((2, 3))])]
