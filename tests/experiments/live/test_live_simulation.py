"""Simulated time that waits for the clock, and does not run after it."""

import pytest

from experiments.live.live_simulation import RealTimeClock


class Wall:
    """A clock that goes on while one sleeps or works."""

    def __init__(self):
        self.now = 100.0

    def sleep(self, seconds):
        self.now += seconds


def run(pace, wall, steps, work, start=0.0):
    """Simulate steps of 10 ms, each of which takes as long as it takes."""
    simulated = start
    for _ in range(steps):
        wall.now += work
        simulated += 0.01
        pace.wait_until(simulated)
    return simulated


@pytest.fixture
def wall():
    return Wall()


@pytest.fixture
def pace(wall):
    pace = RealTimeClock(lambda: wall.now, wall.sleep)
    pace.restart(0.0)
    return pace


def test_what_is_fast_enough_goes_with_the_clock(wall, pace):
    simulated = run(pace, wall, 300, work=0.004)
    assert wall.now - 100.0 == pytest.approx(simulated)
    assert pace.factor == pytest.approx(1.0)


def test_what_is_too_slow_says_how_slow(wall, pace):
    run(pace, wall, 300, work=0.016)
    assert pace.factor == pytest.approx(0.01 / 0.016, rel=0.01)


def test_a_short_halt_is_caught_up_and_a_long_one_is_not(wall, pace):
    simulated = run(pace, wall, 100, work=0.004)
    wall.now += 0.08
    simulated = run(pace, wall, 100, work=0.004, start=simulated)
    assert wall.now - 100.0 == pytest.approx(simulated)
    wall.now += 5.0
    simulated = run(pace, wall, 300, work=0.004, start=simulated)
    assert wall.now - 100.0 - simulated == pytest.approx(4.9, abs=0.02)
    assert pace.factor == pytest.approx(1.0)


def test_time_that_stood_still_does_not_count(wall, pace):
    simulated = run(pace, wall, 100, work=0.004)
    wall.now += 5.0
    pace.restart(simulated)
    run(pace, wall, 50, work=0.004, start=simulated)
    assert pace.factor == pytest.approx(1.0)
