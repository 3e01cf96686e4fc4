"""A reference with a speed scaling from outside, against its base class."""

import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.law.reference import rest_to_rest
from pfsc_drake.control.law.timed_reference import TimedReference
from pfsc_drake.control.law.waiting_reference import WaitingReference
from pfsc_drake.control.obstacles.stoppable_scaling import StoppableScaling

PERIOD = 1e-3
MOTION = rest_to_rest([0.0, 1.0], velocity=0.5, acceleration=2.0, dwell=0.1)


def test_it_starts_at_rest_and_then_is_a_timed_reference():
    pace = StoppableScaling(4, 25.0, 0.05)
    paced = Stepper(WaitingReference(MOTION, pace, 3, PERIOD))
    timed = Stepper(TimedReference(MOTION, 4, 3, PERIOD, 25.0), ("override",))
    timed.start(override=0.0)
    rng = np.random.default_rng(3)
    for asked in np.repeat(rng.uniform(0.0, 1.0, (15, 1)), 100, axis=0):
        ours, theirs = paced.step(override=asked), timed.step(override=asked)
        np.testing.assert_array_equal(ours["reference"], theirs["reference"])
    s, z, rest, *others = ours["clock"]
    assert s + (z + sum(others)) / 25.0 == pytest.approx(rest, abs=1e-12)
    for _ in range(2000):
        clock = paced.step(override=[0.0])["clock"]
    assert s + z / 25.0 <= rest + 1e-12
    assert clock[0] == pytest.approx(rest + asked[0] * PERIOD, abs=1e-9)
    assert clock[1] == pytest.approx(0.0, abs=1e-9)
