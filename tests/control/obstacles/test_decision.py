"""What decides over the pace, asked directly."""

import numpy as np
import pytest

from pfsc_drake.control.obstacles.decision import decision_function
from pfsc_drake.control.obstacles.waiting_pace import WaitingPace
from pfsc_drake.control.obstacles.watch_parameters import WatchParameters

STEP, BEHIND, COUNT = 0.1, 4, 12
PACE = WaitingPace(2, 20.0, 0.05)
TIMES = 1.0 + STEP * np.arange(-BEHIND, COUNT - BEHIND)
FREE, FAR = np.full(COUNT, 9.0), np.full(COUNT, 9.0)


def _decide(left=FREE, expected=FAR, lags=(0.0, 0.0), asked=1.0, passed=0.0, retreat=0.6, s=1.0):
    """Return override, permitted pace, and whether it passes, at own time s."""
    parameters = WatchParameters(margin=0.15, side=0.05, uncertainty=0.04, retreat=retreat)
    decide = decision_function(parameters, PACE, STEP, BEHIND, COUNT)
    clock = [s, lags[0], s + sum(lags) / PACE.bandwidth, lags[1]]
    found = decide(left, expected, TIMES, clock, asked, 9.0, passed)
    return [float(value) for value in found]


def _expected(places, value=0.0):
    """Return what is expected where somebody is at some of the samples."""
    expected = FAR.copy()
    expected[list(places)] = value
    return expected


def test_what_is_free_is_gone_on_at_the_pace_that_is_asked_for():
    assert _decide(asked=0.7) == [0.7, 1.0, 1.0]


@pytest.mark.parametrize("lags", [(1.0, 1.0), (0.3, 0.0), (0.0, 0.2)])
def test_it_turns_back_only_where_it_rests(lags):
    somebody = _expected(range(BEHIND - 1, COUNT))
    assert _decide(expected=somebody, lags=lags)[::2] == [0.0, -1.0]
    back, _, goes = _decide(expected=somebody)
    assert (back, goes) == (pytest.approx(-0.6), -1.0)


@pytest.mark.parametrize("lags", [(-1.0, -1.0), (-0.3, 0.0), (0.0, -0.2)])
def test_it_turns_on_again_only_where_it_rests(lags):
    assert _decide(lags=lags, passed=-1.0)[0] == 0.0
    assert _decide(passed=-1.0)[0] == 1.0


def test_it_goes_back_to_the_nearest_place_to_wait_at_and_slower_towards_it():
    # from 0.9 on somebody is expected; 0.8 is free
    somebody = _expected(range(BEHIND - 1, COUNT))
    near = _decide(expected=somebody, s=0.82, passed=-1.0)[0]
    assert near == pytest.approx(-0.02 * PACE.bandwidth)
    assert _decide(expected=somebody, retreat=0.0)[::2] == [0.0, 0.0]


def test_where_somebody_is_expected_everywhere_it_goes_to_where_most_time_is_left():
    left = FREE.copy()
    left[:] = 1.0
    left[1] = 1.5
    everywhere = _expected(range(COUNT))
    assert _decide(left=left, expected=everywhere)[::2] == [pytest.approx(-0.6), -1.0]
    # not for less than the side room takes
    left[1] = 1.0 + 0.9 * 0.05 / 1.6
    assert _decide(left=left, expected=everywhere)[::2] == [0.0, 0.0]
    assert _decide(left=left, expected=everywhere, passed=-1.0)[2] == -1.0


def test_it_sets_out_within_the_margin_and_comes_back_to_all_of_the_room():
    within = _expected(range(BEHIND - 1, COUNT), 0.17)
    assert _decide(expected=within)[2] == 0.0
    assert _decide(expected=within, passed=-1.0)[2] == -1.0


def test_backwards_the_pace_is_what_can_be_stopped_too():
    somebody, left = _expected(range(BEHIND - 1, COUNT)), FREE.copy()
    left[BEHIND] = 0.5 * PACE.time_to_stop
    back, permitted, _ = _decide(left=left, expected=somebody)
    assert 0.05 < permitted < 0.6
    assert back == pytest.approx(-permitted)
    # also of a place between the tool and where it would rest behind
    left = FREE.copy()
    left[BEHIND - 2] = 0.5 * PACE.time_to_stop
    assert _decide(left=left, lags=(-1.0, -1.0))[1] == 0.0


def test_to_set_off_through_somebody_more_time_is_needed_than_to_go_on():
    somebody, left = _expected(range(BEHIND + 1, BEHIND + 3)), FREE.copy()
    # the next place to wait at is 0.28 s ahead, and what is behind does not count
    left[: BEHIND + 4] = 0.28 + PACE.time_to_stop + 0.04
    given = {"expected": somebody, "retreat": 0.0, "s": 1.02}
    assert _decide(left=left, **given)[2] == 0.0
    assert _decide(left=left, **given, passed=1.0)[2] == 1.0
    assert _decide(left=left + 0.02, **given)[2] == 1.0
    assert _decide(left=left - 0.06, **given, passed=1.0)[2] == 0.0


def test_where_somebody_is_expected_between_two_samples_it_does_not_go_on():
    left = np.full(COUNT, 0.8 * PACE.time_to_stop)
    permitted = _decide(left=left, s=1.02)[0]
    assert 0.05 < permitted < 1.0
    assert _decide(left=left, expected=_expected([BEHIND]), s=1.02, retreat=0.0)[0] == 0.0
    assert _decide(left=left, expected=_expected([BEHIND + 3]), s=1.02)[0] == permitted
