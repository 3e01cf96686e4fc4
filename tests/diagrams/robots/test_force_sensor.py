"""What a station says beforehand of its force/torque sensor."""

import pytest

from diagrams.robots.force_sensor import sensor_warnings


@pytest.mark.parametrize(("dwell", "late"), [(0.049, True), (0.05, False), (0.051, False)])
def test_the_reference_should_not_set_off_before_the_sensor_is_tared(load_scenario, dwell, late):
    """From the sample on with which the window is full, the sensor is tared."""
    settings = load_scenario("operator_hand_6r")
    settings.sensor.taring_time, settings.reference.dwell = 0.05, dwell
    warnings = sensor_warnings(settings)
    assert len(warnings) == late
    assert all("sets off" in warning for warning in warnings)
