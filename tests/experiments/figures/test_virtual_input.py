"""The figure of the law's virtual input, drawn from made-up logs and one of a run."""

import numpy as np
import pytest

from experiments.figures.virtual_input import draw_virtual_input, has_virtual_input
from experiments.results.run_log import RunLog

TIME = np.linspace(0.0, 2.0, 201)


@pytest.fixture(name="log")
def fixture_log():
    """Two tangential and one transversal coordinate, of which the latter converges quickly."""
    log = RunLog(TIME)
    log.add("eta", np.zeros((201, 2)), "m", ["eta_1", "eta_2"])
    log.add("xi", np.zeros(201), "m", ["xi"])
    v = np.column_stack([np.sin(TIME), np.cos(TIME), -30.0 * np.exp(-20.0 * TIME)])
    log.add("virtual_input", v, "SI/s^2", ["v_eta_1", "v_eta_2", "v_xi"])
    return log


def test_each_kind_of_coordinates_has_its_panel(log):
    drawing = draw_virtual_input(log)
    tangential, transversal = drawing.canvas.axes
    shown = {line.get_label(): line.get_ydata() for line in tangential.lines[1:]}
    np.testing.assert_array_equal(shown[r"$v_{\eta_1}$"], np.sin(TIME))
    np.testing.assert_array_equal(shown[r"$v_{\eta_2}$"], np.cos(TIME))
    assert tangential.get_title() == "Tangential"
    assert tangential.get_ylabel() == "$v$ in m/s$^2$"
    assert "second time derivatives" in drawing.caption
    # the start would leave nothing to be seen of the rest
    assert transversal.get_title() == "Transversal, scaled to the last three quarters"
    assert transversal.get_ylim()[1] < 0.01


def test_of_velocity_servos_it_is_a_velocity(log):
    log["virtual_input"].unit = "SI/s^1"
    log.add("phi", np.zeros(201), "rad", ["phi_z"])
    log["virtual_input"].values = np.ones((201, 4))
    log["virtual_input"].labels.append("v_phi_z")
    drawing = draw_virtual_input(log)
    units = [panel.get_ylabel().removeprefix("$v$ in ") for panel in drawing.canvas.axes]
    assert units == ["m/s", "m/s", "rad/s"]
    assert "first time derivatives" in drawing.caption


def test_it_needs_coordinates(log):
    assert has_virtual_input(log)
    log.signals = {"virtual_input": log["virtual_input"]}
    assert not has_virtual_input(log)
