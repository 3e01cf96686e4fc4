"""Figures of an identification: the drawn values are the known ones."""

import numpy as np
import pytest

from identification.estimation.residuals import whiteness
from identification.report import figures


@pytest.fixture(name="canvas")
def fixture_canvas(monkeypatch):
    """Drawings before they are pictures."""
    drawn = []
    monkeypatch.setattr(figures, "render", lambda drawing: drawn.append(drawing) or drawing)
    return drawn


def labelled(panel):
    return {line.get_label(): line.get_ydata() for line in panel.lines}


def test_torques_are_drawn_joint_by_joint(canvas):
    t, random = np.linspace(0.0, 1.0, 50), np.random.default_rng(0)
    measured, predicted = random.normal(size=(2, 50, 2))
    units, title = ("Nm", "N"), "Torques of a motion that was not used"
    figures.fit_figure(t, (measured, predicted), units, title, "")
    panels = canvas[0].canvas.axes
    assert canvas[0].name == "prediction"
    for j, panel in enumerate(panels):
        lines = labelled(panel)
        np.testing.assert_array_equal(lines["measured"], measured[:, j])
        np.testing.assert_array_equal(lines["left"], measured[:, j] - predicted[:, j])
        assert panel.get_ylabel().endswith(units[j])


def test_limits_that_are_unknown_are_not_drawn(canvas):
    limits = np.array([[-1.0, 1.0], [-np.inf, np.inf]])
    t = np.linspace(0.0, 1.0, 20)
    figures.excitation_figure(t, np.zeros((20, 2)), limits, ["rad", "m"])
    first, second = canvas[0].canvas.axes
    assert len(first.lines) == 3
    assert len(second.lines) == 1
    assert second.get_ylabel() == "$q_2$ in m"


def test_white_residuals_stay_within_their_bound(canvas):
    residuals = np.random.default_rng(1).normal(size=(4000, 1))
    test = whiteness(residuals, np.ones((4000, 1), dtype=bool), ["swing"])
    figures.whiteness_figure(test)
    assert test.p_value[0] > 0.01
    (segments,) = canvas[0].canvas.axes[0].collections[-1:]
    heights = np.array([segment[1][1] for segment in segments.get_segments()])
    np.testing.assert_allclose(heights, test.autocorrelation[:, 0])
