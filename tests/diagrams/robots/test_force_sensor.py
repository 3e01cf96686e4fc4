"""The force/torque sensor of a station: delay and warnings."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from diagrams.builder import build_station
from diagrams.robots.force_sensor import taring_warnings
from experiments.scenario_file import find_scenario


@pytest.mark.slow(but=["0.05-False", "0.049-True"])
@pytest.mark.parametrize(("dwell", "late"), [(0.049, True), (0.05, False), (0.051, False)])
def test_the_reference_should_not_set_off_before_the_sensor_is_tared(load_scenario, dwell, late):
    """From the sample on with which the window is full, the sensor is tared."""
    warnings = taring_warnings(0.05, dwell)
    assert len(warnings) == late
    assert all("sets off" in warning for warning in warnings)
    settings = load_scenario("operator_hand_6r")
    settings.sensor.taring_time, settings.reference.dwell = 0.05, dwell
    said = build_station(settings, find_scenario("operator_hand_6r").parent).warnings
    assert set(warnings) <= set(said)


@pytest.mark.parametrize("ticks", [1, 3])
def test_the_controller_has_a_reading_exactly_its_delay_later(load_exact_scenario, ticks):
    settings = load_exact_scenario("pfc_compliant_6r")
    settings.sensor.delay = ticks * settings.controller.sampling_time
    station = build_station(settings, find_scenario("pfc_compliant_6r").parent)
    simulator = Simulator(station.diagram)
    root = simulator.get_mutable_context()
    station.set_start(root)
    simulator.Initialize()
    readings, delayed = [], []
    for tick in range(10):
        if tick > 0:  # each time before the update of the tick
            simulator.AdvanceTo(tick * station.controller.period)
        readings.append(station.blocks.output(root, "force_torque_sensor.measured_wrench"))
        delayed.append(station.blocks.output(root, "force_sensor_delay.held"))
    assert np.ptp(readings, axis=0).min() > 0.0
    np.testing.assert_array_equal(delayed[ticks:], readings[:-ticks])
