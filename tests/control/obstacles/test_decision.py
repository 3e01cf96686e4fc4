"""Decisions on the speed scaling, evaluated directly."""

import numpy as np
import pytest

from pfsc_drake.control.obstacles.decision import decision_function
from pfsc_drake.control.obstacles.stoppable_scaling import StoppableScaling
from pfsc_drake.control.obstacles.watch_parameters import WatchParameters

STEP, BEHIND, COUNT = 0.1, 4, 12
SCALING = StoppableScaling(2, 20.0, 0.05)
TIMES = 1.0 + STEP * np.arange(-BEHIND, COUNT - BEHIND)
FREE, FAR = np.full(COUNT, 9.0), np.full(COUNT, 9.0)


def _decide(
    left=FREE, expected=FAR, lags=(0.0, 0.0), requested=1.0, passed=0.0, retreat=0.6, s=1.0
):
    """Return override, permitted scaling, and whether the motion passes, at motion time s."""
    parameters = WatchParameters(margin=0.15, side=0.05, uncertainty=0.04, retreat=retreat)
    decide = decision_function(parameters, SCALING, STEP, BEHIND, COUNT)
    clock = [s, lags[0], s + sum(lags) / SCALING.bandwidth, lags[1]]
    found = decide(left, expected, TIMES, clock, requested, 9.0, passed)
    return [float(value) for value in found]


def _expected(samples, value=0.0):
    """Return the expected distances with an obstacle at some of the samples."""
    expected = FAR.copy()
    expected[list(samples)] = value
    return expected


def test_free_motion_has_the_requested_scaling():
    assert _decide(requested=0.7) == [0.7, 1.0, 1.0]


@pytest.mark.parametrize("lags", [(1.0, 1.0), (0.3, 0.0), (0.0, 0.2)])
def test_reverses_only_at_rest(lags):
    predicted = _expected(range(BEHIND - 1, COUNT))
    assert _decide(expected=predicted, lags=lags)[::2] == [0.0, -1.0]
    back, _, goes = _decide(expected=predicted)
    assert (back, goes) == (pytest.approx(-0.6), -1.0)


@pytest.mark.parametrize("lags", [(-1.0, -1.0), (-0.3, 0.0), (0.0, -0.2)])
def test_continues_forward_only_after_rest(lags):
    assert _decide(lags=lags, passed=-1.0)[0] == 0.0
    assert _decide(passed=-1.0)[0] == 1.0


def test_retreats_to_the_nearest_waiting_sample_and_slows_down():
    # an obstacle is predicted from 0.9 on; 0.8 is free
    predicted = _expected(range(BEHIND - 1, COUNT))
    near = _decide(expected=predicted, s=0.82, passed=-1.0)[0]
    assert near == pytest.approx(-0.02 * SCALING.bandwidth)
    assert _decide(expected=predicted, retreat=0.0)[::2] == [0.0, 0.0]


def test_without_a_waiting_sample_retreats_to_the_most_time_left():
    left = FREE.copy()
    left[:] = 1.0
    left[1] = 1.5
    everywhere = _expected(range(COUNT))
    assert _decide(left=left, expected=everywhere)[::2] == [pytest.approx(-0.6), -1.0]
    # not for less time than the side distance takes
    left[1] = 1.0 + 0.9 * 0.05 / 1.6
    assert _decide(left=left, expected=everywhere)[::2] == [0.0, 0.0]
    assert _decide(left=left, expected=everywhere, passed=-1.0)[2] == -1.0


def test_retreat_begins_within_the_margin_and_ends_at_the_side_distance():
    within = _expected(range(BEHIND - 1, COUNT), 0.17)
    assert _decide(expected=within)[2] == 0.0
    assert _decide(expected=within, passed=-1.0)[2] == -1.0


def test_backward_scaling_can_be_stopped_too():
    predicted, left = _expected(range(BEHIND - 1, COUNT)), FREE.copy()
    left[BEHIND] = 0.5 * SCALING.time_to_stop
    back, permitted, _ = _decide(left=left, expected=predicted)
    assert 0.05 < permitted < 0.6
    assert back == pytest.approx(-permitted)
    # also for a sample between the tool and its stopping point behind
    left = FREE.copy()
    left[BEHIND - 2] = 0.5 * SCALING.time_to_stop
    assert _decide(left=left, lags=(-1.0, -1.0))[1] == 0.0


def test_starting_a_passage_needs_more_time_than_continuing():
    predicted, left = _expected(range(BEHIND + 1, BEHIND + 3)), FREE.copy()
    # the next waiting sample is 0.28 s ahead; samples behind do not count
    left[: BEHIND + 4] = 0.28 + SCALING.time_to_stop + 0.04
    options = {"expected": predicted, "retreat": 0.0, "s": 1.02}
    assert _decide(left=left, **options)[2] == 0.0
    assert _decide(left=left, **options, passed=1.0)[2] == 1.0
    assert _decide(left=left + 0.02, **options)[2] == 1.0
    assert _decide(left=left - 0.06, **options, passed=1.0)[2] == 0.0


def test_obstacle_between_two_samples_stops_the_motion():
    left = np.full(COUNT, 0.8 * SCALING.time_to_stop)
    permitted = _decide(left=left, s=1.02)[0]
    assert 0.05 < permitted < 1.0
    assert _decide(left=left, expected=_expected([BEHIND]), s=1.02, retreat=0.0)[0] == 0.0
    assert _decide(left=left, expected=_expected([BEHIND + 3]), s=1.02)[0] == permitted
