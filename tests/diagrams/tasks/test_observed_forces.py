"""Forces on the tool without a sensor: observed, compensated, complied with."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from diagrams.builder import build_station
from diagrams.scenario import ForcePulse, JointFrictionParameters
from experiments.scenario_file import SCENARIO_DIRECTORY
from pfsc_drake.errors import InputError
from pfsc_drake.robot.tool_load import joint_torque_function


def run(settings, duration):
    """Return the station, times and log."""
    station = build_station(settings, SCENARIO_DIRECTORY)
    simulator = Simulator(station.diagram)
    station.set_start(simulator.get_mutable_context())
    simulator.AdvanceTo(duration)
    assert station.fault(simulator.get_context()) is None
    times, log = station.log.read(simulator.get_context())
    return station, times, log


@pytest.fixture(name="soft")
def fixture_soft(load_scenario):
    """Six rigid axes at rest on the path that yield sideways, pushed by 20 N."""
    settings = load_scenario("pfc_compliant_6r")
    settings.encoders = type(settings.encoders)()
    settings.model_error = type(settings.model_error)()
    settings.friction = JointFrictionParameters()
    settings.reference.dwell = 2.0
    settings.forces = [ForcePulse(0.02, 2.0, np.array([0.0, 20.0, 0.0]), frame="manifold")]
    settings.controller.friction.source = "none"
    settings.compliance.source = "observed"
    settings.compliance.transversal.mass.value = 1.0
    settings.compliance.transversal.damping.value = 100.0
    return settings


def test_an_arm_yields_without_a_sensor(soft):
    station, _, log = run(soft, 0.5)
    assert "wrench_measured" not in log
    np.testing.assert_allclose(log["wrench_observed"][-1], log["wrench_ext"][-1], rtol=0, atol=0.1)
    xi = log["law"][-1, station.law.layout.manifold_state][1]
    assert xi == pytest.approx(20.0 / 2000.0, rel=0.02)


@pytest.mark.slow
def test_friction_of_rigid_joints_is_no_force_if_it_is_known(soft):
    """Moving against it: the friction model is subtracted from the observed torque."""
    soft.forces, soft.reference.dwell, soft.start.transition = [], 0.05, 0.0
    soft.friction = JointFrictionParameters([20.0] * 3 + [3.0] * 3, [10.0] * 3 + [1.0] * 3)
    soft.compliance.observed.force_dead_band = 1e3  # nothing yields
    found = {}
    for source in ("none", "model"):
        soft.controller.friction.source = source
        _, _, log = run(soft, 0.4)
        found[source] = np.abs(log["tau_ext_observed"][-100:, :3]).max()
    assert found["none"] > 15.0
    assert found["model"] < found["none"] / 4.0


@pytest.mark.slow
def test_the_elastic_law_receives_observed_forces(load_scenario):
    """With derivatives; friction of the drives is no force on the links."""
    settings = load_scenario("pfc_elastic_3r")
    settings.start.offset, settings.reference.dwell = [0.0, 0.0], 1.0
    settings.friction = JointFrictionParameters([5.0, 9.0, 2.0], [14.0, 97.0, 39.0])
    force = np.array([0.0, 40.0, -20.0])
    settings.forces = [ForcePulse(0.05, 1.0, force, ramp=0.1)]
    external_torque = settings.controller.external_torque
    external_torque.source, external_torque.bandwidth = "observed", 150.0
    station, _, log = run(settings, 0.5)
    expected = joint_torque_function(station.robot)(
        log["joint_state"][-1, :3], np.append(force, np.zeros(3))
    )
    np.testing.assert_allclose(
        log["tau_ext_observed"][-1], np.array(expected).ravel(), rtol=0, atol=0.05
    )
    observer = station.diagram.GetSubsystemByName("controller").GetSubsystemByName(
        "external_torque_observer"
    )
    assert observer.GetOutputPort("estimate").size() == 9


def test_what_cannot_be_observed_is_refused(soft):
    soft.controller.friction.source = "observer"
    with pytest.raises(InputError, match=r"cannot be separated; allowed: controller.friction"):
        build_station(soft, SCENARIO_DIRECTORY)
    soft.controller.friction.source, soft.controller.law = "none", "velocity_servo"
    with pytest.raises(InputError, match=r"compliance.source = observed with the law 'velocity_se"):
        build_station(soft, SCENARIO_DIRECTORY)
