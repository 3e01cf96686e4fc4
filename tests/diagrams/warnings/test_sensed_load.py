"""Warnings about the load below the force sensor."""

import numpy as np
import pytest

from diagrams.builder import build_station
from diagrams.scenario import Scenario
from diagrams.station_warnings import sensor_loop
from diagrams.warnings.sensed_load import sensed_load_warnings
from experiments.scenario_file import find_scenario
from pfsc_drake.control.law.loop_at_rest import RestPosture
from pfsc_drake.yaml.typed import load_file


@pytest.fixture(name="warnings", scope="module")
def fixture_warnings():
    """Return what is said of settings; the station is that of the shipped ones."""
    file = find_scenario("sfc_polish")
    settings = load_file(Scenario, file)
    settings.workpiece = None
    station = build_station(settings, file.parent)
    assert station.warnings == []
    robot, task, n = station.part.nominal_model.robot, station.task, station.robot.dimension
    q_J = (station.part.coordinates.link_rows @ station.initial_state)[:n]
    rest = RestPosture(q_J, task.point(task.start(np.zeros(3))))
    load = station.part.nominal_load(settings.sensor.joint)
    return lambda changed: sensed_load_warnings(
        sensor_loop(changed), robot, load, station.law, rest
    )


@pytest.fixture(name="polish")
def fixture_polish(load_scenario):
    return load_scenario("sfc_polish")


def test_the_shipped_mass_tolerates_its_unknown_mass(polish, warnings):
    assert warnings(polish) == []
    polish.sensor.unknown_mass = 3.1
    (warning,) = warnings(polish)
    assert "3.1 kg below it" in warning
    assert "compliance.transversal.mass of 6.2 kg or more" in warning


def test_a_tool_whose_inertia_is_felt_is_too_much_for_a_small_mass(polish, warnings):
    """2 kg answer to 1.6 of the tool: another 1.5 kg and the drives jump between their limits."""
    polish.compliance.transversal.mass.value = 2.0
    polish.sensor.inertia, polish.sensor.unknown_mass = "none", 0.0
    (warning,) = warnings(polish)
    assert "may oscillate" in warning and "sensor.inertia: differentiated" in warning
    polish.sensor.unknown_mass = 1.5
    (warning,) = warnings(polish)
    assert "more than 0.5 the loop is unstable" in warning
    polish.sensor.inertia, polish.sensor.unknown_mass = "differentiated", 0.9
    assert warnings(polish) == []


def test_turning_counts_too(polish, warnings):
    polish.sensor.inertia = "none"
    polish.compliance.transversal.mass.value = 20.0
    assert warnings(polish) == []
    polish.compliance.rotational.stiffness.value = 10.0
    polish.compliance.rotational.mass.value = 0.02
    (warning,) = warnings(polish)
    assert "compliance.rotational.mass of 0." in warning and "kg m^2" in warning


def test_servos_or_no_sensor_tolerate_more(polish, warnings):
    polish.sensor.unknown_mass = 4.0
    assert len(warnings(polish)) == 1
    polish.controller.law = "velocity_servo"
    assert warnings(polish) == []
    polish.controller.law, polish.compliance.source = "rigid", "observed"
    assert warnings(polish) == []


def test_coarse_encoders_make_too_much_of_inertia(polish, warnings):
    polish.encoders.link_increments = polish.encoders.motor_increments = [100000]
    (warning,) = warnings(polish)
    assert "second difference" in warning
