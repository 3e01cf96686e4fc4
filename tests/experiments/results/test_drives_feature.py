"""Law and drives: torques, limits and virtual input, from made-up logs."""

import numpy as np
import pytest

from diagrams.scenario import Scenario
from experiments.results.drives_feature import (
    draw_efforts,
    draw_virtual_input,
    limit_reversals,
    peak_torque,
    saturation_count,
)
from experiments.results.requirements import leave_unjudged, missed_targets, set_targets
from experiments.results.run_log import RunLog
from reporting.metrics import Metrics


def test_reversals_from_limit_to_limit_are_counted_of_what_drives_apply():
    """Ten in 0.1 s on the second axis; the first is at one limit, the third within both."""
    time = 0.01 * np.arange(21)
    torque = np.tile([2.0, 0.0, 4.9], (21, 1))
    torque[::2, 1] = 3.0 * (-1.0) ** np.arange(11)
    log = RunLog(time)
    log.add("tau_d", torque, "Nm", limits=[2.0, 3.0, 5.0])
    fault = np.zeros(21)
    log.add("fault", fault, "1", ["none"])
    forgotten = np.exp(-0.02 / 0.2)
    expected = (1.0 - forgotten**10) / (1.0 - forgotten)
    assert limit_reversals(log) == pytest.approx(expected, rel=1e-9)
    fault[5:] = 4.0  # from then on the law does not command
    log.add("fault", fault, "1", ["none"])
    assert limit_reversals(log) == pytest.approx(1.0 + forgotten, rel=1e-9)
    log.add("tau_d", 0.9 * torque, "Nm", limits=[2.0, 3.0, 5.0])
    assert limit_reversals(log) == 0.0


def test_reversals_from_limit_to_limit_are_a_requirement_with_the_bound_of_the_supervision():
    scenario, found = Scenario(), Metrics()
    scenario.faults.chatter_turns = 4.0
    found.add("limit_reversals", 4.5)
    set_targets(found, scenario)
    leave_unjudged(found, fault=False)
    assert missed_targets(found) == ["limit_reversals = 4.5, target < 4"]


def test_torques_and_saturation():
    torque = np.array([[1.0, -5.0], [-3.0, 2.0], [2.9, 5.0 * (1 - 1e-12)], [0.0, 4.9]])
    log = RunLog(np.arange(4.0))
    log.add("tau_d", torque, "Nm", limits=[3.0, 5.0])
    np.testing.assert_allclose(peak_torque(log), [3.0, 5.0])
    assert saturation_count(log) == 3
    log.add("tau_d", torque, "Nm")
    assert saturation_count(log) == 0


def test_what_a_law_asks_too_much_of_servos_counts():
    """Speeds that the law asks for, torques of the servos, and the safe state after a fault."""
    log = RunLog(np.arange(6.0))
    log.add("tau_d", np.array([1.0, 3.0, 1.0, 1.0, 1.0, -3.0]), "Nm", limits=3.0)
    log.add("saturated_drives", np.array([0, 2, 1, 0, 6, 0]), "1")
    log.add("fault", np.array([0, 0, 0, 0, 4, 4]), "1", ["none"])
    # sample 4: the law asks in vain, for there is a fault; sample 5: the drives brake
    assert saturation_count(log) == 3
    del log.signals["tau_d"]
    assert saturation_count(log) == 2


def test_only_limits_within_reach_are_drawn(drawn_log):
    panels = draw_efforts(drawn_log).canvas.axes
    dashed = [
        [line.get_ydata()[0] for line in panel.lines if line.get_linestyle() == "--"]
        for panel in panels
    ]
    # Axis 3 of 1, 2, 3 Nm is the only one beyond half of 5 Nm in the first panel.
    assert dashed == [[-5.0, 5.0], [-5.0, 5.0] * 3]
    assert "limits" in draw_efforts(drawn_log).caption
    drawn_log["tau_d"].values *= 0.4  # 2.4 Nm at most
    assert "limits" not in draw_efforts(drawn_log).caption


def test_a_short_peak_does_not_hide_the_rest(drawn_log):
    drawn_log["tau_d"].values[:3, 0] = 100.0
    panels = draw_efforts(drawn_log).canvas.axes
    titles = [panel.get_title() for panel in panels]
    assert titles == [
        "Drive torques, axes 1 to 3",
        "Scaled to the last three quarters",
        "Drive torques, axes 4 to 6",
    ]
    late = np.abs(drawn_log["tau_d"].values[50:, :3]).max()
    assert panels[1].get_ylim() == pytest.approx((-1.2 * late, 1.2 * late))
    # axes 1 and 3 come near their limits, two lines each
    assert [len(panel.lines) for panel in panels[:2]] == [3 + 4, 3]


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
    assert draw_virtual_input(log)
    log.signals = {"virtual_input": log["virtual_input"]}
    assert draw_virtual_input(log) is None
