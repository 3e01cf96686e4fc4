"""Compensation of the weight of a grasped payload in a wrench."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.compliance.measured_wrench import PayloadCompensation, SensorFault

MASS, CENTER, GRAVITY = 0.8, np.array([0.01, -0.02, 0.03]), np.array([0, 0, -9.81])
R = Rotation.from_euler("ZYX", [20.0, 15.0, 170.0], degrees=True)
POSE = np.concatenate([[0.5, 0.2, 0.7], R.as_matrix().ravel()])
WRENCH = np.array([1.0, 2.0, 3.0, 0.4, 0.5, 0.6])


def compensated(held, tared):
    """Return the output at the last of some ticks."""
    stepper = Stepper(PayloadCompensation(MASS, CENTER, GRAVITY))
    outs = [
        stepper.step(wrench=WRENCH, tool_pose=POSE, held=share, tared=done, sensor_fault=0.0)
        for share, done in zip(held, tared, strict=True)
    ]
    return outs[-1]["payload_free"]


def load(share):
    """Weight of a body that hangs on the tool, about the tool point."""
    force = share * MASS * GRAVITY
    return np.concatenate([force, np.cross(R.apply(CENTER), force)])


def test_without_a_payload_nothing_changes():
    np.testing.assert_array_equal(compensated([0, 0], [0, 1]), WRENCH)


@pytest.mark.parametrize("share", [0.25, 1.0])
def test_the_weight_of_the_payload_is_subtracted(share):
    expected = WRENCH - load(share)
    np.testing.assert_allclose(compensated([0, share], [0, 1]), expected, atol=1e-12)


def test_what_was_tared_is_not_taken_off_twice():
    np.testing.assert_allclose(compensated([1, 1, 1], [0, 0, 1]), WRENCH, atol=1e-12)
    # and once it is gone the bias has its weight, which is given back
    expected = WRENCH + load(1.0)
    np.testing.assert_allclose(compensated([1, 1, 1, 0], [0, 0, 1, 1]), expected, atol=1e-12)
    # what is held at the tick of taring itself is not in the bias
    expected = WRENCH - load(1.0)
    np.testing.assert_allclose(compensated([0, 1, 1], [0, 1, 1]), expected, atol=1e-12)


@pytest.mark.parametrize("share", [np.nan, np.inf, -np.inf])
def test_a_share_that_is_no_number_loses_the_sensor(share):
    stepper = Stepper(PayloadCompensation(MASS, CENTER, GRAVITY))
    inputs = {"wrench": WRENCH, "tool_pose": POSE, "tared": 1.0}
    assert stepper.step(held=share, sensor_fault=0.0, **inputs)["fault"] == SensorFault.LOST
    for fault in (SensorFault.NONE, SensorFault.SATURATED):
        assert stepper.step(held=1.0, sensor_fault=fault, **inputs)["fault"] == fault
