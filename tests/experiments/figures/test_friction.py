"""Figures of what is thought of friction."""

import numpy as np
import pytest

from experiments.figures.drives import draw_friction_coefficients, draw_friction_estimate
from experiments.results.run_log import RunLog


@pytest.fixture(name="log")
def fixture_log():
    time = np.linspace(0.0, 10.0, 101)
    log, rising = RunLog(time), 1.0 - 0.3 * np.exp(-time)
    log.add("tau_f", np.outer(np.sign(np.sin(time)), [40.0, 9.0]), "Nm")
    log.add("friction_estimate", np.outer(rising * np.sign(np.sin(time)), [40.0, 9.0]), "Nm")
    log.add("momentum", np.outer(np.sin(time), [30.0, 2.0]), "Nm s")
    for name, unit in (("f_c", "Nm"), ("f_v", "Nm s/rad")):
        log.add(name, np.outer(np.ones(101), [40.0, 9.0]), unit)
        log.add(f"{name}_estimate", np.outer(rising, [40.0, 9.0]), unit)
    return log


def test_the_estimate_lies_over_the_truth(log):
    panels = draw_friction_estimate(log).canvas.axes
    assert [panel.get_title() for panel in panels] == ["Axis 1", "Axis 2"]
    true, estimate = panels[1].lines
    assert np.array_equal(true.get_ydata(), log["tau_f"].values[:, 1])
    assert np.array_equal(estimate.get_ydata(), log["friction_estimate"].values[:, 1])


def test_coefficients_in_per_cent_of_the_true_ones(log):
    momentum, coulomb, viscous = draw_friction_coefficients(log).canvas.axes
    assert np.array_equal(momentum.lines[1].get_ydata(), log["momentum"].values[:, 1])
    assert momentum.get_ylabel() == "momentum in Nm s"
    for panel in (coulomb, viscous):
        curve = panel.lines[1].get_ydata()
        assert curve[0] == pytest.approx(70.0)
        assert curve[-1] == pytest.approx(100.0, abs=0.01)
        # late values decide the scale
        assert panel.get_ylim()[0] > 70.0


def test_momenta_of_the_last_axes_have_a_panel_of_their_own(log):
    log.add("momentum", np.outer(np.ones(101), np.arange(1.0, 7.0)), "Nm s")
    first, last, *_ = draw_friction_coefficients(log).canvas.axes
    assert [line.get_label() for line in first.lines] == ["$p_1$", "$p_2$", "$p_3$"]
    assert [line.get_label() for line in last.lines] == ["$p_4$", "$p_5$", "$p_6$"]
    assert last.lines[-1].get_ydata()[0] == 6.0
