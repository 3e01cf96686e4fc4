"""Tangential, rotational and variable compliance of a station with sensor and robot."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from diagrams.builder import build_station
from diagrams.scenario import ForcePulse, Scenario
from experiments.results.run_signals import collect_log
from experiments.simulation import simulate
from pfsc_drake.control.compliance.impedance_parameters import CoordinateImpedance, Profile
from pfsc_drake.geometry import quaternion_to_matrix
from tests.scenarios import LONG

SCENARIOS = Path(__file__).parents[3] / "experiments" / "scenarios"
TICK = 1e-3


def impedance(mass, damping, stiffness):
    return CoordinateImpedance(Profile(mass), Profile(damping), stiffness)


@pytest.fixture
def settings(load_exact_scenario) -> Scenario:
    """Six rigid axes that rest on the path; nothing yields, and the sensor is exact."""
    settings = load_exact_scenario("pfc_compliant_6r")
    settings.compliance.transversal = CoordinateImpedance()
    settings.reference.points = [0.3, 0.3]
    settings.sensor.noise, settings.sensor.bias = np.zeros(6), np.zeros(6)
    settings.forces = []
    return settings


@pytest.fixture
def arm(settings):
    """The same with three axes on the lemniscate, which is compiled and run faster."""

    def three_axes(lemniscate: Scenario):
        settings.robot.model = "comau_racer_1_4_3r"
        settings.path = lemniscate.path
        settings.start.posture_deg = [15, 115, -10]
        settings.reference.points = [0.96, 0.96]
        return settings

    return three_axes


def run(settings, duration):
    settings.simulation.fused = duration >= LONG
    station = build_station(settings, SCENARIOS)
    result = simulate(station, settings.simulation, duration, lambda *_: None)
    assert result.fault is None
    return station, collect_log(station, result.root), station.log.read(result.root)[1]


@pytest.mark.slow(but="-12.0")
@pytest.mark.parametrize("force", [12.0, -12.0])
def test_a_push_along_the_path_shifts_the_reference(arm, load_scenario, force):
    stiffness = 600.0
    settings = arm(load_scenario("pfc_elastic_3r"))
    settings.compliance.tangential = impedance(3.0, 85.0, Profile(stiffness))
    push = np.array([force, 0.0, 0.0])
    settings.forces = [ForcePulse(0.1, 2.0, push, ramp=0.05, frame="manifold")]
    _, log, _ = run(settings, 1.2)
    late = log.time > 1.15
    shift = force / stiffness
    np.testing.assert_allclose(log["eta_p"].values[late] - 0.96, shift, rtol=0.01)
    np.testing.assert_allclose(log["eta"].values[late] - 0.96, shift, atol=1e-3)
    np.testing.assert_allclose(log["eta_d"].values, 0.96, atol=1e-12)
    assert np.abs(log["xi_p"].values).max() == 0.0
    assert np.abs(log["xi"].values[late]).max() < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("with_turning", [False, True])
def test_a_torque_pushes_along_a_path_that_turns_if_it_is_to(settings, with_turning):
    """By its power: torque times the turn of the path's orientation per metre."""
    settings.compliance.tangential = impedance(3.0, 85.0, Profile(6000.0))
    settings.compliance.with_turning = with_turning
    torque = np.array([4.0, -3.0, 5.0])
    settings.forces = [ForcePulse(0.06, 2.0, np.zeros(3), torque, ramp=0.02)]
    station, log, _ = run(settings, 0.15)
    theta = station.path.arc_length.parameter
    ends = [station.path.orientation.rotation_matrix(theta(0.3 + h)) for h in (1e-4, -1e-4)]
    turn = Rotation.from_matrix(ends[0] @ ends[1].T).as_rotvec() / 2e-4
    assert abs(turn @ torque) > 1.0
    expected = turn @ torque if with_turning else 0.0
    assert log["manifold_force"].values[-1, 0] == pytest.approx(expected, abs=0.3)


@pytest.mark.slow(but="2")
@pytest.mark.parametrize("axis", range(3))
def test_a_torque_turns_the_tool(settings, axis):
    """By tau / k about the axis of the torque, in the world, whatever the angles are called."""
    stiffness, torque = 20.0, np.zeros(3)
    torque[axis] = 0.5
    settings.compliance.rotational = impedance(0.1, 2.8, Profile(stiffness))
    settings.forces = [ForcePulse(0.1, 2.0, np.zeros(3), torque, ramp=0.05)]
    station, log, _ = run(settings, 0.9)
    theta = log["theta"].values[-1, 0]
    R_d = quaternion_to_matrix(station.path.orientation.derivatives(theta, 0)[0])
    R_e = log["R_e"].values[-1].reshape(3, 3)
    turn = Rotation.from_matrix(R_e @ R_d.T).as_rotvec()
    np.testing.assert_allclose(turn, torque / stiffness, atol=0.03 * 0.5 / stiffness)
    # the position stays, and so does the reference of the position
    assert np.linalg.norm(log["xi"].values[-1]) < 1e-3
    assert np.abs(log["eta_p"].values - 0.3).max() < 1e-12
    # phi are the ZYX angles of R_d' R_e
    zyx = Rotation.from_matrix(R_d.T @ R_e).as_euler("ZYX")
    np.testing.assert_allclose(log["phi"].values[-1], zyx, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("width", [0.06, 0.001])
def test_stiffness_that_changes_on_the_way_moves_nothing_at_once(arm, load_scenario, width):
    """Under a constant force, from 600 to 3000 N/m within ``width`` of the way."""
    settings = arm(load_scenario("pfc_elastic_3r"))
    mass, damping, force, soft, stiff = 3.0, 120.0, 15.0, 600.0, 3000.0
    middle = 0.90
    profile = Profile(at=[middle - width / 2, middle + width / 2], values=[stiff, soft])
    settings.compliance.transversal = impedance(mass, damping, profile)
    settings.reference.points = [0.96, 0.84]
    settings.reference.velocity, settings.reference.dwell = 0.2, 1.2
    settings.forces = [ForcePulse(0.1, 4.0, [0.0, force, 0.0], ramp=0.05, frame="manifold")]
    _, log, raw = run(settings, 3.0)
    before, after = log.time < 1.2, log.time > 2.9
    xi_p = log["xi_p"].values[:, 0]
    assert xi_p[before][-1] == pytest.approx(force / soft, rel=0.02)
    np.testing.assert_allclose(xi_p[after], force / stiff, rtol=0.05)
    # m e'' = F - d e' - k e: neither e nor e' steps, however fast k changes
    velocity = raw["reference"][:, 3 + 1]
    bound = (2.0 * force + damping * np.abs(velocity) + stiff * np.abs(xi_p)) / mass
    assert np.all(np.abs(np.diff(velocity)) <= 1.2 * TICK * bound[1:] + 1e-9)
    assert np.all(np.abs(np.diff(xi_p)) <= 1.2 * TICK * np.abs(velocity).max())
    moved = np.abs(np.diff(xi_p)).max()
    assert moved < 0.02 * abs(force / soft - force / stiff)


@pytest.mark.slow
def test_a_sensor_that_is_never_tared_moves_nothing(arm, load_scenario):
    """Too restless to be tared: biased, pushed along, across and by a moving reference."""
    settings = arm(load_scenario("pfc_elastic_3r"))
    kind = impedance(3.0, 85.0, Profile(600.0))
    settings.compliance.tangential = settings.compliance.transversal = kind
    settings.sensor.bias = np.array([20.0, -15.0, 10.0, 0.5, -0.4, 0.3])
    settings.sensor.noise = np.array([3.0, 3.0, 3.0, 0.1, 0.1, 0.1])
    settings.reference.points, settings.reference.dwell = [0.96, 0.93], 0.1
    push = np.array([10.0, 10.0, 0.0])
    settings.forces = [ForcePulse(0.2, 0.5, push, ramp=0.05, frame="manifold")]
    _, log, _ = run(settings, 0.6)
    assert np.abs(log["tared"].values).max() == 0.0
    assert np.abs(log["wrench_ext"].values).max() > 5.0
    assert np.abs(log["wrench_measured"].values).max() == 0.0
    # what would yield waits, though the external reference sets off
    np.testing.assert_allclose(log["eta_p"].values, 0.96, rtol=0, atol=1e-9)
    np.testing.assert_allclose(log["xi_p"].values, 0.0, rtol=0, atol=1e-9)
    assert np.ptp(log["eta_d"].values) > 0.02


@pytest.mark.slow
def test_rigid_coordinates_do_not_wait(arm, load_scenario):
    settings = arm(load_scenario("pfc_elastic_3r"))
    settings.compliance.transversal = impedance(3.0, 85.0, Profile(600.0))
    settings.sensor.noise = np.array([3.0, 3.0, 3.0, 0.1, 0.1, 0.1])
    settings.reference.points, settings.reference.dwell = [0.96, 0.93], 0.1
    station, log, _ = run(settings, 0.4)
    assert np.abs(log["tared"].values).max() == 0.0
    np.testing.assert_array_equal(log["eta_p"].values, log["eta_d"].values)
    assert np.ptp(log["eta"].values) > 0.01
    assert station.warnings == []


def test_a_reference_that_sets_off_before_taring_is_warned_of(arm, load_scenario):
    settings = arm(load_scenario("pfc_elastic_3r"))
    settings.compliance.tangential = impedance(3.0, 85.0, Profile(600.0))
    settings.reference.dwell, settings.sensor.taring_time = 0.1, 0.2
    (warning,) = build_station(settings, SCENARIOS).warnings
    assert "reference.dwell" in warning and "taring_time" in warning
