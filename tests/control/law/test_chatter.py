"""Drives that jump between their limits, and those that only give all they have."""

import numpy as np
import pytest

from pfsc_drake.control.law.chatter import Chatter

PERIOD, LIMITS = 1e-3, np.array([10.0, 1800.0])


def first_found(drive, turns=6.0):
    """Return the first tick at which a sequence of drive torques is chatter, None if none is."""
    chatter = Chatter(2, turns, PERIOD)
    memory = np.zeros(chatter.size)
    for k, torque in enumerate(drive):
        memory = chatter.advance(memory, np.array([0.0, torque]), LIMITS)
        if chatter.chattering(memory).any():
            assert chatter.chattering(memory).tolist() == [False, True]
            return k
    return None


@pytest.mark.parametrize(("frequency", "found"), [(185.0, 30), (50.0, 100), (20.0, 300)])
def test_a_loop_that_swings_between_both_limits_is_found(frequency, found):
    time = PERIOD * np.arange(1000)
    tick = first_found(1800.0 * np.sign(np.sin(2.0 * np.pi * frequency * time + 0.1)))
    assert tick is not None and tick < found


def test_what_is_between_the_limits_in_between_does_not_matter():
    time = PERIOD * np.arange(1000)
    swing = 3600.0 * np.sin(2.0 * np.pi * 60.0 * time)
    assert first_found(np.clip(swing, -1800.0, 1800.0)) is not None
    assert first_found(0.499 * swing) is None


def test_one_limit_only_or_a_reversal_is_none():
    rng = np.random.default_rng(3)
    noisy = 1800.0 * np.clip(1.0 + rng.standard_normal(2000), -0.99, 1.0)
    assert first_found(noisy) is None
    stops = np.repeat([1800.0, -1800.0, 1800.0, -1800.0, 0.0], 200)
    assert first_found(np.tile(stops, 5)) is None


def test_none_is_found_if_none_is_looked_for():
    assert first_found(1800.0 * np.resize([1.0, -1.0], 500), turns=np.inf) is None
