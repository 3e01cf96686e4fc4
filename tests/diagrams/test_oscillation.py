"""Commands that swing to and fro, and those that only move."""

import numpy as np
import pytest

from diagrams.oscillation import oscillating_drives

TIMES = 1e-3 * np.arange(100)
LIMITS = np.array([100.0, 40.0])


@pytest.mark.parametrize(
    ("frequency", "swing", "found"),
    [(90.0, 30.0, True), (480.0, 30.0, True), (90.0, 22.0, False), (30.0, 60.0, False)],
)
def test_fast_oscillations_by_a_quarter_of_the_limit(frequency, swing, found):
    """Peak to peak, on a command that grows."""
    commands = np.zeros((100, 2))
    commands[:, 0] = 20.0 + 50.0 * TIMES + 0.5 * swing * np.sin(2.0 * np.pi * frequency * TIMES)
    assert oscillating_drives(commands, LIMITS).tolist() == ([0] if found else [])


def test_motion_noise_and_unlimited_drives_do_not_oscillate():
    rng = np.random.default_rng(2)
    commands = np.column_stack([150.0 * np.sin(20.0 * TIMES), rng.normal(0.0, 1.0, 100)])
    assert not len(oscillating_drives(commands, LIMITS))
    bang = np.resize([-40.0, 40.0], (100, 1)) * [1.0, 1.0]
    assert oscillating_drives(bang, np.array([np.inf, 40.0])).tolist() == [1]
    assert not len(oscillating_drives(np.zeros((0, 2)), LIMITS))
