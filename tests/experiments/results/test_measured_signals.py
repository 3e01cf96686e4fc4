"""What is logged of imperfect encoders: the truth, and beside it what they measured."""

from pathlib import Path

import numpy as np
import pytest

from diagrams.builder import build_station
from diagrams.scenario import EncoderOptions, GainParameters, LawGains
from experiments.results.recorded_motion import collect_motion
from experiments.results.run_signals import collect_log
from experiments.simulation import simulate
from tests.scenarios import shipped_scenario

DURATION = 0.3


COARSE = 2000.0


@pytest.fixture
def settings():
    settings = shipped_scenario("pfc_elastic_3r")
    settings.robot.model = "comau_racer_1_4_3r"
    settings.controller.law = "rigid"
    poles = GainParameters(poles=[-30.0, -30.0])
    settings.controller.gains = {"rigid": LawGains(poles, poles)}
    settings.reference.dwell = 0.02
    return settings


def run(settings):
    station = build_station(settings, Path())
    result = simulate(station, settings.simulation, DURATION, lambda *_: None)
    return station, result.root, collect_log(station, result.root)


@pytest.mark.slow
def test_perfect_encoders_add_nothing(settings):
    _, _, log = run(settings)
    assert not [name for name in log.signals if name.endswith("_measured")]


def test_truth_and_measurement(settings):
    settings.encoders = EncoderOptions(link_increments=[COARSE], motor_increments=[COARSE])
    station, root, log = run(settings)
    resolution = 2.0 * np.pi / COARSE
    q_J, measured = log["q_J"].values, log["q_J_measured"].values
    np.testing.assert_allclose(measured / resolution, np.round(measured / resolution), atol=1e-9)
    assert 0.3 * resolution < np.abs(q_J - measured).max() <= 0.5 * resolution * (1 + 1e-9)
    # the truth is smooth: differences of its second order are those of an acceleration
    assert np.abs(np.diff(q_J, 2, axis=0)).max() < 0.05 * resolution
    np.testing.assert_array_equal(log["v_J"].values, log["v_J_measured"].values)
    assert log["q_J_measured"].labels == ["q_J_measured_1", "q_J_measured_2", "q_J_measured_3"]
    assert log["v_J_measured"].unit == "rad/s"
    assert "q_M_measured" not in log  # rigid joints
    # the pose is where Drake says the tool really is
    plant = station.part.model
    context = plant.GetMyContextFromRoot(root)
    y_t = station.part.tool.CalcPoseInWorld(context).translation()
    np.testing.assert_allclose(log["y_t"].values[-1], y_t, atol=1e-9)


def test_path_coordinates_are_those_of_the_true_tool(settings):
    """Against a projection of the true tool point by brute force."""
    settings.encoders = EncoderOptions(link_increments=[COARSE], motor_increments=[COARSE])
    station, _, log = run(settings)
    theta = np.linspace(*station.path.position.domain, 200_001)
    sigma = station.path.position.derivatives(theta, 0)[:, 0]
    for k in (50, 150, 300):
        distance = np.linalg.norm(sigma - log["y_t"].values[k], axis=1).min()
        assert np.linalg.norm(log["xi"].values[k]) == pytest.approx(distance, abs=1e-7)
    difference = np.linalg.norm(log["xi"].values - log["xi_measured"].values, axis=1)
    assert 1e-4 < difference.max() < 5e-3
    assert np.abs(log["eta"].values - log["eta_measured"].values).max() < 5e-3
    assert np.ptp(log["eta"].values) > 5e-3


def test_the_recording_shows_the_truth(settings):
    settings.encoders = EncoderOptions(link_increments=[COARSE], motor_increments=[COARSE])
    station, root, log = run(settings)
    motion = collect_motion(station, root, 0.05, log, 0.0)
    ticks = np.round(motion.times / 1e-3).astype(int)
    np.testing.assert_allclose(motion.positions, log["q_J"].values[ticks], atol=1e-12)


def test_motors_of_elastic_joints_are_measured_too(settings):
    settings.robot.model = "comau_racer_1_4_elastic_3r"
    settings.encoders = EncoderOptions(motor_increments=[1e5], difference_quotient=True)
    _, _, log = run(settings)
    resolution = 2.0 * np.pi / 1e5
    error = log["q_M_measured"].values - log["q_M"].values
    assert 0.0 < np.abs(error).max() <= 0.5 * resolution * (1 + 1e-6)
    np.testing.assert_allclose(log["q_J_measured"].values, log["q_J"].values, atol=1e-12)
    # the law acts on motors: its coordinates keep their name
    assert "xi_M" in log
    assert "xi_measured" not in log
    # the spring's torque is the true one
    np.testing.assert_allclose(
        log["tau_J"].values,
        np.array([35e3, 35e3, 19e3]) * (log["q_M"].values - log["q_J"].values),
        atol=1e-6,
    )
