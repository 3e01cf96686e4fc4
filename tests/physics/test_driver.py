"""The low pass of a driver, against its closed form."""

import math

import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.physics.driver import DriveLowPass, low_pass_share

PERIOD = 1e-3


def test_it_begins_with_the_command_and_follows_a_step():
    """The torque that carries the weight at the start is not removed first."""
    weight, step = np.array([100.0, -40.0]), np.array([8.0, 5.0])
    driver, w = Stepper(DriveLowPass(2, 30.0, PERIOD)), 2.0 * math.pi * 30.0 * PERIOD
    for _ in range(3):
        np.testing.assert_array_equal(driver.step(command=weight)["passed"], weight)
    for k in range(1, 20):
        passed = driver.step(command=weight + step)["passed"]
        np.testing.assert_allclose(passed, weight + step * (1.0 - (1.0 + w) ** -k), rtol=1e-12)


@pytest.mark.parametrize(("cutoff", "share"), [(0.0, 1.0), (1e9, 1.0), (500.0 / math.pi, 0.5)])
def test_without_a_cut_off_all_passes(cutoff, share):
    assert low_pass_share(cutoff, PERIOD) == pytest.approx(share, abs=1e-6)
