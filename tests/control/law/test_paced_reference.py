"""A speed that permits a stop for any change of the free path."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.law.paced_reference import PacedReference
from pfsc_drake.control.law.timed_reference import StreamLimits

PERIOD, M = 1e-3, 3
LIMITS = StreamLimits(velocity=0.4, acceleration=2.0, bandwidth=25.0)


def paced(goal, ticks, order=4, ways=None, **given):
    """Return reference rows, stop and overrun at each tick; ``goal(sample, outputs before)``."""
    stretches = 1 if ways is None else len(ways[1])
    block = PacedReference(LIMITS, order, M, PERIOD, stretches=stretches)
    if ways is not None:
        given |= {"stretches": ways[0], "stretch_speeds": ways[1]}
    stepper = Stepper(block, tuple(given))
    rows, stops, overruns, before = [], [], [], 0.0
    for k in range(ticks):
        told = stepper.step(goal=goal(k, before), **given)
        rows.append(told["reference"].reshape(order + 1, M))
        stops.append(told["stop"][0])
        overruns.append(told["overrun"][0])
        before = stops[-1]
    return np.array(rows), np.array(stops), np.array(overruns)


@pytest.mark.slow(but=["1-0", "2-1", "4-2", "4-3"])
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("order", [1, 2, 4])
def test_a_free_way_that_grows_and_shrinks_is_never_passed(seed, order):
    """Its end comes as near as where it would rest, at any time, and not nearer."""
    random, goals = np.random.default_rng(seed), []

    def goal(k, stop):
        if k == 0 or random.random() < 5e-3:
            goals.append(max(stop, (goals[-1] if goals else 0.0) + random.normal(0.03, 0.1)))
        else:
            goals.append(max(stop, goals[-1]))
        return goals[-1]

    rows, stops, overruns = paced(goal, 4000, order)
    eta, ends = rows[:, :, 0], np.array(goals)
    assert not rows[:, :, 1:].any()
    assert np.all(eta[1:, 0] <= ends[:-1] + 1e-9)
    assert np.all(stops <= ends + 1e-9)
    assert overruns.max() <= 1e-9
    assert eta[-1, 0] > 0.15
    assert eta[:, 1].max() <= LIMITS.velocity * (1.0 + 1e-9)
    assert np.abs(np.diff(eta[:, 1])).max() <= LIMITS.acceleration * PERIOD * (1.0 + 1e-6)
    for k in range(order):
        means = PERIOD * (eta[1:, k + 1] + eta[:-1, k + 1]) / 2.0
        scale = LIMITS.acceleration * LIMITS.bandwidth ** (k + 1) * PERIOD**3
        np.testing.assert_allclose(np.diff(eta[:, k]), means, rtol=0, atol=scale)


def test_it_is_as_fast_as_the_limits_allow():
    """From rest to rest over 0.5 m in the time of a trapezoid and of the lags."""
    rows, _, _ = paced(lambda k, stop: 0.5, 3000)
    eta = rows[:, 0, 0]
    shortest = 0.5 / LIMITS.velocity + LIMITS.velocity / LIMITS.acceleration
    arrived = PERIOD * np.argmax(eta > 0.5 - 1e-4)
    assert shortest < arrived < shortest + 12.0 / LIMITS.bandwidth


def test_the_reference_is_the_lags_of_the_trapezoid():
    """``(d/dt / b + 1)^2 y = p``, p from its own speeds, integrated by another method."""
    rows, _, _ = paced(lambda k, stop: 10.0, 800, order=2)
    b, V, A = LIMITS.bandwidth, LIMITS.velocity, LIMITS.acceleration

    def rate(t, x):
        p = A * t**2 / 2.0 if t < V / A else V * t - V**2 / (2.0 * A)
        return [x[1], b**2 * (p - x[0]) - 2.0 * b * x[1]]

    times = PERIOD * np.arange(800)
    solved = solve_ivp(rate, (0.0, times[-1]), [0.0, 0.0], t_eval=times, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(rows[:, 0, 0], solved.y[0], rtol=0, atol=1e-8)


def test_slow_stretches_are_reached_slowly_and_left_at_once():
    ways = np.array([0.0, 0.2, 0.25, 0.5]), np.array([0.4, 0.1, 0.4])
    rows, _, _ = paced(lambda k, stop: 0.5, 4000, ways=ways)
    eta, speed = rows[:, 0, 0], rows[:, 1, 0]
    on = (eta > 0.2) & (eta < 0.25)
    # y is a mean of where p was, a little of it from before
    assert speed[on].max() < 0.1 * 1.03
    assert speed[eta < 0.2].max() > 0.35
    assert speed[eta > 0.25].max() > 0.3


def test_an_end_that_comes_too_near_is_told_before_it_is_passed():
    def goal(k, stop):
        return 1.0 if k < 600 else 0.15

    rows, _, overruns = paced(goal, 3000)
    eta = rows[:, 0, 0]
    first = int(np.argmax(overruns > 0.0))
    assert first == 600
    assert eta[first] < 0.15
    # it was told as if a tick went by until it brakes
    half_a_tick = PERIOD * LIMITS.velocity / 2.0
    assert overruns[first] - half_a_tick <= eta[-1] - 0.15 + 1e-9 <= overruns[first]
    assert np.abs(np.diff(rows[:, 1, 0])).max() <= LIMITS.acceleration * PERIOD * (1.0 + 1e-6)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_an_end_that_is_no_number_lets_it_stop(bad):
    rows, _, _ = paced(lambda k, stop: 1.0 if k < 400 else bad, 2500)
    speed = rows[:, 1, 0]
    assert speed[400] > 0.2
    assert abs(speed[-1]) < 1e-6
    assert np.isfinite(rows).all()


def test_speed_that_is_asked_for_is_kept():
    rows, _, _ = paced(lambda k, stop: 1.0, 2000, speed=0.05)
    assert rows[:, 1, 0].max() == pytest.approx(0.05, rel=1e-6)
