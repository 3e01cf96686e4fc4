"""Friction compensation of stations: each source on robots of each kind, in the loop."""

from pathlib import Path

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from diagrams.builder import build_station
from diagrams.robots.nominal_model import nominal_robot
from diagrams.scenario import JointFrictionParameters
from experiments.scenario_file import SCENARIO_DIRECTORY
from pfsc_drake.errors import InputError
from pfsc_drake.physics.friction import FrictionDrift
from tests.scenarios import LONG

F_C, F_V = [40.0, 90.0, 20.0], [14.0, 97.0, 39.0]


def run(settings, duration=1.0):
    """Return the station, times and log."""
    settings.simulation.fused = duration >= LONG
    station = build_station(settings, SCENARIO_DIRECTORY)
    simulator = Simulator(station.diagram)
    station.set_start(simulator.get_mutable_context())
    simulator.AdvanceTo(duration)
    assert station.fault(simulator.get_context()) is None
    times, log = station.log.read(simulator.get_context())
    return station, times, log


def off_path(station, log):
    """Return the largest distance from the path after 0.3 s [m]."""
    y = log["law"][300:, station.law.layout.manifold_state]
    return np.linalg.norm(y[:, 1:3], axis=1).max()


@pytest.fixture(name="arm")
def fixture_arm(load_scenario):
    """Three elastic axes with friction, on their path from the start, soon in motion."""
    settings = load_scenario("pfc_elastic_3r")
    settings.start.offset, settings.reference.dwell = [0.0, 0.0], 0.05
    settings.friction = JointFrictionParameters(F_C, F_V)
    return settings


@pytest.mark.slow
def test_every_source_keeps_the_tool_nearer_to_its_path(arm):
    found = {}
    for source, velocity, observer in (
        ("none", "measured", "kalman"),
        ("model", "reference", "kalman"),
        ("observer", "measured", "disturbance"),
        ("observer", "reference", "kalman"),
    ):
        friction = arm.controller.friction
        friction.source, friction.velocity, friction.observer = source, velocity, observer
        friction.rate = 300.0
        station, _, log = run(arm, 0.45)
        found[source, velocity, observer] = off_path(station, log)
    without = found.pop(("none", "measured", "kalman"))
    assert without > 0.01
    assert max(found.values()) < without / 8.0


@pytest.mark.slow
def test_the_estimate_is_the_true_friction(arm):
    """Of the disturbance observer after its lag; of the filter the coefficients, too."""
    arm.controller.friction.source = "observer"
    arm.controller.friction.rate = 400.0
    _, times, log = run(arm, 0.6)
    moving = times > 0.4
    lag = np.exp(-400.0 * times[: times.size // 2])[:, None]
    late = sum(np.roll(log["friction_torque"], k, axis=0) * lag[k] for k in range(60))
    late /= lag[:60].sum()
    error = np.abs(log["friction_estimate"] - late)[moving]
    assert np.all(error.mean(axis=0) < 0.03 * np.abs(log["friction_torque"]).max(axis=0))
    arm.controller.friction.observer = "kalman"
    arm.controller.friction.kalman.start = 0.7
    _, _, log = run(arm, 1.2)
    np.testing.assert_allclose(log["friction_estimate"][-1, 3:6], F_C, rtol=0.02)
    np.testing.assert_allclose(log["friction_estimate"][-1, 6:], F_V, rtol=0.06)


@pytest.mark.slow
def test_forces_on_the_tool_that_are_known_are_no_friction_of_rigid_joints(load_scenario):
    """Pushed at rest: known forces are not taken for friction."""
    settings = load_scenario("pfc_compliant_6r")
    settings.forces[0].begin, settings.forces[0].ramp = 0.0, 0.05
    settings.forces[0].end, settings.reference.dwell = 2.0, 1.0
    settings.compliance.transversal.stiffness.value = np.inf
    settings.encoders, settings.model_error = (
        type(settings.encoders)(),
        type(settings.model_error)(),
    )
    settings.controller.friction.source = "observer"
    settings.friction = JointFrictionParameters([1.0] * 6, [1.0] * 6)
    ends = {}
    for source in ("none", "known"):
        settings.controller.external_torque.source = source
        _, _, log = run(settings, 0.2)
        ends[source] = np.abs(log["friction_estimate"][-1]).max()
    assert ends["none"] > 20.0
    assert ends["known"] < 1.5


@pytest.mark.slow
def test_the_belief_is_the_plants_with_its_error_or_what_is_written(arm):
    arm.controller.friction.source = "model"
    arm.model_error.friction = [0.5]

    def torque(velocity=1.0):
        station = build_station(arm, Path())
        model = station.diagram.GetSubsystemByName("controller").GetSubsystemByName(
            "friction_compensation"
        )
        context = model.CreateDefaultContext()
        model.GetInputPort("velocity").FixValue(context, np.full(12, velocity))
        return model.GetOutputPort("friction_torque").Eval(context)

    np.testing.assert_allclose(torque(), 0.5 * (np.array(F_C) + F_V), rtol=1e-12)
    arm.controller.friction.nominal = JointFrictionParameters([1.0, 2.0, 3.0], [4.0, 5.0, 6.0])
    np.testing.assert_allclose(torque(-1.0), [-5.0, -7.0, -9.0], rtol=1e-12)


@pytest.mark.slow
def test_friction_that_drifts(arm):
    """Nothing else changes: the plant's friction is that of the start times the drift."""
    arm.friction.drift = FrictionDrift(1.5, 0.2, 0.4)
    arm.controller.friction.source = "observer"
    arm.controller.friction.rate = 600.0
    station, times, log = run(arm, 0.6)
    friction = station.diagram.GetSubsystemByName("joint_friction")
    f_c, f_v = friction.coefficients(times)
    np.testing.assert_allclose(f_c[times >= 0.4], np.tile(1.5 * np.array(F_C), (201, 1)))
    v = log["joint_state"][:, 9:]
    sliding = np.abs(v) > 0.05
    expected = f_c * np.sign(v) + f_v * v
    np.testing.assert_allclose(
        log["friction_torque"][sliding], expected[sliding], rtol=1e-6, atol=1e-6
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"source": "model"}, r"source = model: no nominal friction; write"),
        ({"source": "observer", "observer": "kalman"}, "observer = kalman: no nominal friction"),
    ],
)
def test_without_coefficients(arm, change, message):
    arm.friction = JointFrictionParameters()
    for key, value in change.items():
        setattr(arm.controller.friction, key, value)
    with pytest.raises(InputError, match=message):
        build_station(arm, Path())


def test_wrong_choices_are_refused(arm):
    friction = arm.controller.friction
    friction.source, friction.observer = "observer", "kalman"
    friction.kalman.momentum_noise = [1.0, 1.0]
    with pytest.raises(InputError, match=r"kalman.momentum_noise: 2 values; allowed: 1 or 3"):
        build_station(arm, Path())
    friction.kalman.momentum_noise = [1.0]
    friction.nominal = JointFrictionParameters([1.0], [1.0, 2.0, 3.0])
    with pytest.raises(InputError, match=r"controller.friction.nominal.f_c = \[1\.0\]; allowed: "):
        build_station(arm, Path())


@pytest.mark.slow
def test_friction_is_left_to_the_servos_with_a_warning(load_scenario):
    settings = load_scenario("pfc_compliant_6r")
    settings.controller.law = "velocity_servo"
    for source, watched in (("observer", False), ("none", True), ("none", False)):
        settings.controller.friction.source = source
        settings.controller.friction.watched = watched
        station = build_station(settings, SCENARIO_DIRECTORY)
        assert "friction_estimate" not in station.log.rows
        said = any("controller.friction is not used" in line for line in station.warnings)
        assert said == (source != "none" or watched)


def test_a_difference_quotient_is_the_velocity_half_an_interval_ago(load_scenario, load_arm):
    settings, robot = load_scenario("pfc_elastic_3r"), load_arm("comau_racer_1_4_elastic_3r").chain
    T, t = settings.controller.sampling_time, 0.7
    assert nominal_robot(robot, settings.encoders, T).velocity_delay == 0.0
    settings.encoders.difference_quotient = True
    delay = nominal_robot(robot, settings.encoders, T).velocity_delay
    # exactly so of a motion with constant acceleration
    q = [3.0 * time**2 - time for time in (t, t - T)]
    assert (q[0] - q[1]) / T == pytest.approx(6.0 * (t - delay) - 1.0, rel=1e-9)
