"""Metrics of what is thought of friction, on logs made by hand."""

from pathlib import Path

import numpy as np
import pytest

from diagrams.builder import build_station
from diagrams.scenario import GainParameters, JointFrictionParameters, LawGains
from experiments.results.friction_feature import (
    draw_friction,
    draw_friction_coefficients,
    draw_friction_estimate,
    friction_metrics,
)
from experiments.results.run_log import RunLog
from experiments.results.run_signals import collect_log, expected_signals
from experiments.simulation import simulate
from pfsc_drake.robot.models.robot_parameters import load_parameters
from tests.experiments.results.registry_names import names_about
from tests.scenarios import shipped_scenario
from tests.shades import spans


def make_log():
    log = RunLog(np.linspace(0.0, 1.0, 5))
    log.add("tau_f", np.outer(np.ones(5), [3.0, -4.0]), "Nm")
    log.add("friction_estimate", np.outer(np.ones(5), [3.5, -4.0]), "Nm")
    log.add("f_c", np.outer(np.linspace(1.0, 2.0, 5), [10.0, 0.0]), "Nm")
    log.add("f_c_estimate", np.outer(np.ones(5), [19.0, 1.0]), "Nm")
    log.add("f_v", np.outer(np.ones(5), [4.0, 8.0]), "Nm s/rad")
    log.add("f_v_estimate", np.outer(np.ones(5), [4.2, 6.0]), "Nm s/rad")
    return log


def test_errors_of_torques_and_of_coefficients_at_the_end():
    metrics = friction_metrics(make_log())
    assert metrics["rms_friction_error_1"].value == pytest.approx(0.5)
    assert metrics["rms_friction_error_2"].value == 0.0
    assert metrics["coulomb_error_1"].value == pytest.approx(0.05)
    assert np.isnan(metrics["coulomb_error_2"].value)  # there is no such friction
    assert metrics["max_coulomb_error"].value == pytest.approx(0.05)
    assert metrics["max_viscous_error"].value == pytest.approx(0.25)
    assert metrics["viscous_error_1"].value == pytest.approx(0.05)


def test_names_are_those_of_the_metrics():
    log = make_log()
    assert list(friction_metrics(log)) == names_about(log, "tau_f", "f_c", "f_v", drives=2)
    bare = RunLog(np.linspace(0.0, 1.0, 5))
    assert not friction_metrics(bare)
    assert not names_about(bare, "tau_f", "f_c", "f_v", drives=2)


@pytest.fixture(name="settings")
def fixture_settings():
    """Return three axes that are observed on their way to the path, masses believed 10 % low."""
    settings = shipped_scenario("pfc_elastic_3r")
    settings.friction = JointFrictionParameters([4.0, 9.0, 2.0], [1.0, 9.0, 3.0])
    settings.controller.friction.source = "observer"
    settings.controller.friction.observer = "kalman"
    settings.model_error.mass = [0.9]
    return settings


def run(settings):
    station = build_station(settings, Path())
    result = simulate(station, settings.simulation, 0.1, lambda *_: None)
    log = collect_log(station, result.root)
    assert log["momentum"].unit == "Nm s"
    assert log["momentum"].labels == ["p_1", "p_2", "p_3"]
    assert expected_signals(station) == set(log.signals)
    assert {"momentum", "f_c", "f_v_estimate", "friction_estimate", "tau_f"} <= set(log.signals)
    return station.part.model, result.root, log


@pytest.mark.slow
def test_of_rigid_joints_it_is_that_of_arm_and_rotors(settings):
    settings.robot.model = "comau_racer_1_4_3r"
    settings.controller.law = "rigid"
    poles = GainParameters(poles=[-30.0, -30.0])
    settings.controller.gains = {"rigid": LawGains(poles, poles)}
    plant, root, log = run(settings)
    context = plant.GetMyContextFromRoot(root)
    momentum = plant.CalcMassMatrix(context) @ plant.GetVelocities(context)
    assert np.abs(momentum).max() > 0.5
    np.testing.assert_allclose(log["momentum"].values[-1], momentum, rtol=1e-6, atol=1e-6)


@pytest.mark.slow
def test_of_elastic_joints_it_is_that_of_the_motors(settings):
    _, _, log = run(settings)
    inertia = load_parameters("comau_racer_1_4").rotors.reflected_inertia[:3]
    assert np.abs(log["v_M"].values).max() > 0.01
    np.testing.assert_allclose(log["momentum"].values, inertia * log["v_M"].values, rtol=1e-12)


def test_friction_with_the_velocity_it_acts_on(drawn_log):
    """Both zeros at one height; at rest where the velocity is below a hundredth."""
    time = drawn_log.time
    drawn_log["v_M"].values = np.outer(np.clip(time - 0.5, -0.1, 0.1), np.full(6, 2.0))
    drawing = draw_friction(drawn_log)
    left, right = drawing.canvas.axes[2], drawing.canvas.axes[6 + 2]
    np.testing.assert_array_equal(left.lines[0].get_ydata(), drawn_log["tau_f"].values[:, 2])
    np.testing.assert_array_equal(right.lines[0].get_ydata(), drawn_log["v_M"].values[:, 2])
    assert left.get_ylabel() == "torque in Nm"
    assert right.get_ylabel() == "motor velocity\nin rad/s"
    for panel in (left, right):
        assert sum(panel.get_ylim()) == pytest.approx(0.0)
    assert spans(left) == [pytest.approx((0.5, 0.505))]


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
