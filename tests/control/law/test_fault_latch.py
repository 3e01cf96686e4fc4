"""The first fault is latched, and switches the commands to the drives."""

import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.law.fault import Fault, FaultLatch, FaultSwitch


def test_the_first_fault_stays():
    latch = Stepper(FaultLatch(["law", "drives"]))
    told = [(0.0, 0.0), (0.0, 7.0), (4.0, 0.0), (0.0, 0.0)]
    found = [latch.step(law=law, drives=drives)["fault"][0] for law, drives in told]
    assert found == [Fault.NONE, Fault.DRIVE_SATURATED, Fault.DRIVE_SATURATED, 7.0]


def test_of_two_at_once_the_root_cause_counts():
    assert Stepper(FaultLatch(["law", "drives"])).step(law=4.0, drives=7.0)["fault"] == 4.0


@pytest.mark.parametrize("fault", [0.0, 7.0])
def test_what_drives_are_told(fault):
    drive, stop = np.array([1.0, np.nan]), np.array([-2.0, 3.0])
    switch = Stepper(FaultSwitch(2), ("stop",))
    told = switch.step(drive=drive, stop=stop, fault=fault)["command"]
    np.testing.assert_array_equal(told, stop if fault else drive)
    alone = Stepper(FaultSwitch(2)).step(drive=drive, fault=fault)["command"]
    np.testing.assert_array_equal(alone, np.zeros(2) if fault else drive)
