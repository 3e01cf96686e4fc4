"""A reference that starts where the tool is."""

import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.law.reference import SmoothStart, Transition

WANTED = np.array([0.5, 0.0, 0.1, 0.0, 0.0, 0.0])  # of two outputs with two derivatives
PERIOD = 1e-3
ACTUAL = np.array([0.52, -0.01, 0.0, 0.0])


def _start(actual=ACTUAL, begin=0.0):
    """Return the reference at a time, in a stepper that goes on to it."""
    stepper = Stepper(SmoothStart(0.2, 2, 2, 4, PERIOD))
    stepper.tick = round(begin / PERIOD)

    def reference(time):
        while stepper.tick <= round(time / PERIOD):
            put_out = stepper.step(desired_reference=WANTED, manifold_state=actual)
        return put_out["reference"]

    return reference


@pytest.mark.parametrize("begin", [0.0, 3.0])
def test_begins_at_the_tool_and_ends_at_the_reference(begin):
    reference = _start(begin=begin)
    np.testing.assert_allclose(reference(begin), [0.52, -0.01, 0.1, 0, 0, 0], atol=1e-12)
    half = reference(begin + 0.1)
    np.testing.assert_allclose(half[:2], [0.51, -0.005], atol=1e-9)
    assert half[2] < 0.1
    assert half[3] > 0.0
    np.testing.assert_array_equal(reference(begin + 0.2), WANTED)


@pytest.mark.parametrize("begin", [0.0, 3.0])
def test_follows_the_transition_from_tick_to_tick(begin):
    reference, transition = _start(begin=begin), Transition(0.2, 2)
    distance = ACTUAL[:2] - WANTED[:2]
    for tick in range(205):
        time = (round(begin / PERIOD) + tick) * PERIOD
        rest = np.outer(transition.at(time - begin).full(), distance).ravel()
        expected = WANTED + rest if time - begin < 0.2 else WANTED
        np.testing.assert_allclose(reference(time), expected, atol=1e-10)


@pytest.mark.slow
def test_it_waits_with_the_time_of_its_reference():
    """Own time ``s = t - sin(8 t) / 8``, which rests at first; derivatives by the chain rule."""
    stepper = Stepper(SmoothStart(0.2, 2, 2, 4, PERIOD), ("own_time",))
    distance, transition = ACTUAL[:2] - WANTED[:2], Transition(0.2, 2)
    for tick in range(800):
        t = tick * PERIOD
        s, rate, change = t - np.sin(8.0 * t) / 8.0, 1.0 - np.cos(8.0 * t), 8.0 * np.sin(8.0 * t)
        found = stepper.step(
            desired_reference=WANTED, manifold_state=ACTUAL, own_time=[3.0 + s, rate, change]
        )["reference"]
        value, slope, bend = transition.at(s).full().ravel()
        shares = [value, slope * rate, bend * rate**2 + slope * change]
        expected = WANTED + np.outer(shares, distance).ravel() * (s < 0.2)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)


def test_a_tool_that_is_nowhere_has_no_distance():
    reference = _start(np.array([np.nan, -0.01, 0.0, 0.0]))
    np.testing.assert_allclose(reference(0.0)[:2], [0.5, -0.01], atol=1e-12)
