"""Faults of force sensor and compliance that stop a robot."""

import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.compliance.measured_wrench import SensorFault
from pfsc_drake.control.compliance.tool_compensation import Alarms
from pfsc_drake.control.law.fault import Fault


@pytest.mark.parametrize(
    ("alarms", "fault"),
    [
        ([SensorFault.NONE, 0, 0, 0], Fault.NONE),
        ([SensorFault.LOST, 0, 3, 1], Fault.FORCE_SENSOR_LOST),
        ([SensorFault.SATURATED, 1, 3, 1], Fault.FORCE_SENSOR_SATURATED),
        ([SensorFault.JUMPED, 1, 3, 1], Fault.FORCE_SENSOR_JUMPED),
        # before it is tared its range does not matter
        ([SensorFault.SATURATED, 0, 0, 0], Fault.NONE),
        ([SensorFault.NONE, 1, 3, 1], Fault.COMPLIANCE_INVALID),
        ([SensorFault.NONE, 1, 0, 1], Fault.PRESS_FORCE_LOST),
    ],
)
def test_the_root_cause_comes_first(alarms, fault):
    assert Stepper(Alarms(), ("alarms",)).step(alarms=alarms)["fault"] == fault


def test_without_sensor_and_compliance_there_are_none():
    assert Stepper(Alarms()).step()["fault"] == Fault.NONE
