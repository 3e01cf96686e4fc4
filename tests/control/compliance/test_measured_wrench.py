"""A wrench that somebody else has measured: passed on, and a fault where it is no number."""

import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.compliance.measured_wrench import MeasuredWrench
from pfsc_drake.control.compliance.tool_compensation import SensorFault


@pytest.mark.parametrize("spoiled", [None, np.nan, np.inf, -np.inf])
def test_what_is_no_finite_number_is_a_lost_sensor(spoiled):
    wrench = np.arange(6.0)
    wrench[4] = wrench[4] if spoiled is None else spoiled
    told = Stepper(MeasuredWrench()).step(wrench=wrench)
    np.testing.assert_array_equal(told["measured"], wrench)
    assert told["sensor_fault"][0] == (SensorFault.NONE if spoiled is None else SensorFault.LOST)
    assert told["tared"][0] == 1.0
