"""Drives that jump between their limits, and those that only give all they have."""

import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.supervision import DriveWatch, SupervisionParameters

PERIOD, LIMITS = 1e-3, np.array([10.0, 1800.0])


def first_found(drive, turns=6.0):
    """Return the first tick at which a sequence of drive torques is chatter, None if none is."""
    watch = Stepper(DriveWatch(LIMITS, SupervisionParameters(chatter_turns=turns), PERIOD))
    for k, torque in enumerate(drive):
        if watch.step(drive=[0.0, torque], stopping=0.0)["fault"] == Fault.DRIVE_CHATTERS:
            assert (watch.states["turns"] > turns - 1.0).tolist() == [False, True]
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
    assert first_found(1800.0 * np.resize([1.0, -1.0], 500), turns=0.0) is None


@pytest.mark.parametrize(("cycle", "found"), [([1], 20), ([1, 1, 0], 40), ([1, 0, 0], None)])
def test_ticks_at_a_limit_count_and_others_take_off_half(cycle, found):
    """Twenty ticks; of [1, 1, 0] three ticks count 1.5, of [1, 0, 0] nothing."""
    parameters = SupervisionParameters(saturation_time=20 * PERIOD, chatter_turns=0.0)
    watch = Stepper(DriveWatch(LIMITS, parameters, PERIOD))
    faults = []
    for k in range(100):
        told = LIMITS * [0.5, -cycle[k % len(cycle)]]
        faults.append(watch.step(drive=told, stopping=0.0)["fault"][0])
    at = next((k for k, fault in enumerate(faults) if fault), None)
    assert at is None if found is None else abs(at - found) <= 2
    assert set(faults) <= {Fault.NONE, Fault.DRIVE_SATURATED}


def test_what_stops_a_robot_does_not_count():
    watch = Stepper(DriveWatch(LIMITS, SupervisionParameters(saturation_time=0.01), PERIOD))
    watch.step(drive=LIMITS, stopping=0.0)
    before = watch.states
    for sign in np.resize([1.0, -1.0], 100):
        assert watch.step(drive=sign * LIMITS, stopping=2.0)["fault"] == Fault.NONE
    for name, value in before.items():
        assert np.array_equal(watch.states[name], value)


def test_time_within_the_limits_is_no_credit():
    """A thousand samples at half the limit, then 20 at the limit: the twenty-first is a fault."""
    watch = Stepper(DriveWatch(LIMITS, SupervisionParameters(saturation_time=0.02), PERIOD))
    faults = [
        watch.step(drive=share * LIMITS, stopping=0.0)["fault"][0]
        for share in np.repeat([0.5, 1.0], [1000, 30])
    ]
    assert faults.index(Fault.DRIVE_SATURATED) == 1020
