"""Compliance of a path following station: sensor, taring, filter, refusals."""

from pathlib import Path

import numpy as np
import pytest
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from diagrams.builder import build_station
from diagrams.scenario import GainParameters, LawGains, Scenario
from pfsc_drake.control.compliance.impedance_parameters import CoordinateImpedance, Profile
from pfsc_drake.control.compliance.measured_wrench import SensorFault
from pfsc_drake.errors import InputError
from pfsc_drake.physics.scripted_force import ForcePulse
from pfsc_drake.yaml.typed import load_typed
from tests.scenarios import LONG

TICK = 1e-3
STIFFNESS = 2000.0


def soft(stiffness=STIFFNESS):
    return CoordinateImpedance(Profile(10.0), Profile(400.0), Profile(stiffness))


@pytest.fixture
def settings(load_scenario) -> Scenario:
    """Three rigid axes that rest on the path and yield transversally."""
    settings = load_scenario("pfc_elastic_3r")
    settings.robot.model = "comau_racer_1_4_3r"
    settings.controller.law = "rigid"
    poles = GainParameters(poles=[-80.0, -80.0])
    settings.controller.gains = {"rigid": LawGains(poles, poles)}
    settings.start.offset = [0.0, 0.0]
    settings.reference.points, settings.reference.dwell = [0.96, 0.90], 5.0
    settings.compliance.transversal = soft()
    settings.sensor.noise = np.zeros(6)
    return settings


def run(settings, duration):
    settings.simulation.fused = duration >= LONG
    station = build_station(settings, Path())
    simulator = Simulator(station.diagram)
    configuration = SimulatorConfig(
        integration_scheme="runge_kutta2", max_step_size=TICK, use_error_control=False
    )
    ApplySimulatorConfig(configuration, simulator)
    station.set_start(simulator.get_mutable_context())
    simulator.Initialize()
    simulator.AdvanceTo(duration)
    return station, *station.log.read(simulator.get_context())


def test_rigid_everywhere_is_no_compliance():
    assert not Scenario().compliance.is_given
    settings = Scenario()
    settings.compliance.rotational = soft()
    assert settings.compliance.is_given
    settings.compliance.rotational = CoordinateImpedance(
        Profile(1.0), Profile(1.0), Profile(at=[0.0, 1.0], values=[1.0, 2.0])
    )
    assert settings.compliance.is_given


@pytest.mark.slow
def test_an_untared_sensor_moves_nothing(settings):
    """A bias of 40 N would deflect by 20 mm."""
    settings.sensor.bias = np.array([40.0, -30.0, 20.0, 1.0, -1.0, 0.5])
    _, t, signals = run(settings, 0.3)
    tared = signals["tared"][:, 0] > 0.5
    assert 0.04 < t[tared][0] < 0.07
    assert np.abs(signals["wrench_measured"][~tared]).max() == 0.0
    motion = np.abs(signals["tool_pose"] - signals["tool_pose"][0])
    assert motion[~tared].max() < 1e-9
    yielding = np.abs(signals["reference"] - signals["desired_reference"][:, :9])
    # it starts where the tool is, not where that should be
    assert yielding[~tared].max() < 1e-12
    # afterwards what the mean of the window missed, some 10 mN
    assert motion.max() < 2e-5


def test_the_reference_starts_where_the_tool_is(settings):
    """An arm that starts beside its path is not pulled onto it before its sensor is tared."""
    settings.start.offset = [0.01, -0.005]
    _, _, signals = run(settings, 0.03)
    assert not signals["tared"].any()
    reference = signals["reference"][:, 1:3]
    np.testing.assert_allclose(reference, np.tile([0.01, -0.005], (len(reference), 1)), atol=1e-8)
    assert np.abs(signals["tool_pose"] - signals["tool_pose"][0]).max() < 1e-8


def test_a_sensor_too_weak_for_its_tool_says_so(settings):
    """The tool weighs 14 N."""
    settings.sensor.measurement_range = np.repeat([10.0, 20.0], 3)
    _, _, signals = run(settings, 0.1)
    assert np.all(signals["sensor_fault"][2:] == SensorFault.SATURATED)
    assert not signals["tared"].any()


@pytest.mark.slow(but="1")
@pytest.mark.parametrize("axis", [1, 2])
def test_a_force_deflects_as_a_spring(settings, axis):
    force = np.zeros(3)
    force[axis] = 30.0
    settings.forces = [ForcePulse(0.1, 2.0, force, ramp=0.05, frame="manifold")]
    _, t, signals = run(settings, 1.4)
    late = t > 1.35
    # m e'' + d e' + k e = F is at rest after seven of its slow time constants, 0.17 s each
    deflection = signals["reference"][late][:, axis]
    np.testing.assert_allclose(deflection, 30.0 / STIFFNESS, rtol=0.01)
    xi = signals["law"][late][:, 3 + axis]  # after three drive torques
    np.testing.assert_allclose(xi, deflection, atol=1e-3)
    np.testing.assert_allclose(signals["manifold_force"][late][:, axis], 30.0, atol=0.3)
    measured, applied = signals["wrench_measured"][late], signals["wrench_ext"][late]
    np.testing.assert_allclose(measured, applied, atol=0.3)


@pytest.mark.slow
def test_a_rigid_coordinate_does_not_yield(settings):
    settings.compliance.transversal = CoordinateImpedance()
    settings.compliance.tangential = soft()
    settings.forces = [ForcePulse(0.1, 2.0, np.array([0.0, 30.0, 0.0]), frame="manifold")]
    _, _, signals = run(settings, 0.5)
    assert np.abs(signals["reference"][:, 1:3]).max() == 0.0
    assert np.abs(signals["reference"][:, 0] - 0.96).max() < 1e-3


@pytest.mark.slow
def test_the_filter_knows_four_derivatives(settings):
    settings.reference.dwell = 0.1
    _, _, signals = run(settings, 0.3)
    assert signals["desired_reference"].shape[1] == 15
    # without a force the loop gets what is desired
    difference = signals["reference"] - signals["desired_reference"][:, :9]
    assert np.abs(signals["desired_reference"][:, 3]).max() > 0.1
    assert np.abs(difference[:, ::3]).max() == 0.0


def test_a_trajectory_does_not_yield(settings):
    settings.controller.manifold = "trajectory"
    with pytest.raises(InputError, match=r"compliance.*controller\.manifold = trajectory.*path"):
        build_station(settings, Path())


@pytest.mark.parametrize(
    ("joint", "part"),
    [("nowhere", r"sensor\.joint.*no joint 'nowhere'"), ("joint_3", "joint_3.*fixed")],
)
def test_a_sensor_in_the_wrong_place(settings, joint, part):
    settings.sensor.joint = joint
    with pytest.raises(InputError, match=part):
        build_station(settings, Path())


@pytest.mark.slow
def test_differentiated_encoders_are_warned_of(settings):
    assert build_station(settings, Path()).warnings == []
    settings.encoders.difference_quotient = True
    # exact, the difference is none
    assert build_station(settings, Path()).warnings == []
    settings.encoders.link_increments = settings.encoders.motor_increments = [50000]
    words = "\n".join(build_station(settings, Path()).warnings)
    assert "tared" in words and "one increment of joint" in words
    settings.sensor.inertia = "none"
    assert "tared" not in "\n".join(build_station(settings, Path()).warnings)


@pytest.mark.parametrize(
    ("data", "part"),
    [
        ({"sensor": {"noise": [1.0]}}, "noise"),
        ({"sensor": {"inertia": "given"}}, "inertia"),
        ({"sensor": {"taring_time": 0.0}}, "taring_time"),
        ({"compliance": {"transversal": {"mass": {"value": 1.0}}}}, "damping"),
        ({"servo": {"bandwidth": 0.0}}, "bandwidth"),
        ({"servo": {"bus_delay": -1.0}}, "bus_delay"),
        ({"friction": {"f_c": [-1.0]}}, "f_c"),
        ({"friction": {"f_c": [1.0], "file": "comau_racer_1_4"}}, "file"),
    ],
)
def test_values_out_of_range(data, part):
    with pytest.raises(InputError, match=part):
        load_typed(Scenario, data, "mine.yaml")
