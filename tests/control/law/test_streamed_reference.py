"""A reference towards waypoints that are received while the tool moves."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import gamma

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.law.reference import rest_to_rest
from pfsc_drake.control.law.timed_reference import StreamedReference, StreamLimits
from pfsc_drake.errors import InputError

PERIOD, M = 1e-3, 3
LIMITS = StreamLimits(velocity=0.4, acceleration=2.0, bandwidth=25.0)


def streamed(order, goals, speeds=None, limits=LIMITS, **options):
    """Return the reference by rows at each tick, shape (ticks, order + 1, m)."""
    connected = () if speeds is None else ("speed",)
    stepper = Stepper(StreamedReference(limits, order, M, PERIOD, **options), connected)
    rows = []
    for k, goal in enumerate(goals):
        given = {"goal": goal} | ({} if speeds is None else {"speed": speeds[k]})
        rows.append(stepper.step(**given)["reference"].reshape(order + 1, M))
    return np.array(rows)


def any_stream(seed, ticks=3000):
    """Return arc lengths of last waypoints that grow now and then, and NaN."""
    random = np.random.default_rng(seed)
    steps = random.exponential(0.1, ticks) * (random.random(ticks) < 4e-3)
    steps[ticks // 2 :] = 0.0  # it runs dry
    goals = np.cumsum(steps)
    accepted = goals.copy()
    goals[random.random(ticks) < 0.3] = np.nan
    goals[random.random(ticks) < 0.1] -= 1.0
    return goals, accepted


@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("seed", [0, 1])
def test_a_stream_is_followed_smoothly_within_its_limits_and_never_beyond(order, seed):
    goals, most = any_stream(seed)
    rows = streamed(order, goals)
    eta = rows[:, :, 0]
    assert not rows[:, :, 1:].any()
    assert np.all(eta[1:, 0] <= most[:-1] + 1e-12)
    assert eta[:, 1].min() > -1e-12
    assert eta[:, 1].max() <= LIMITS.velocity * (1.0 + 1e-9)
    assert eta[:, 1].max() > 0.5 * LIMITS.velocity
    acceleration = np.diff(eta[:, 1]) / PERIOD
    assert np.abs(acceleration).max() <= LIMITS.acceleration * (1.0 + 1e-6)
    for k in range(order):
        # each derivative is what the one below grows by, whenever waypoints come
        means = PERIOD * (eta[1:, k + 1] + eta[:-1, k + 1]) / 2.0
        scale = LIMITS.acceleration * LIMITS.bandwidth ** (k + 1) * PERIOD**3
        np.testing.assert_allclose(np.diff(eta[:, k]), means, rtol=0, atol=scale)
    # nor does the highest one jump: its rate is that of the lags under an acceleration of A
    steepest = LIMITS.acceleration * LIMITS.bandwidth ** (order - 1)
    assert np.abs(np.diff(eta[:, order])).max() <= 2.0 * steepest * PERIOD


def test_it_comes_to_rest_at_the_last_way_point():
    goals = np.full(3000, np.nan)
    goals[[0, 500]] = 0.1, 0.25
    eta = streamed(4, goals)[:, :, 0]
    assert 0.05 < eta[500, 0] < 0.1
    np.testing.assert_allclose(eta[-1], [0.25, 0, 0, 0, 0], rtol=0, atol=1e-6)


@pytest.mark.parametrize("order", [1, 4])
def test_one_way_point_is_gone_to_by_a_trapezoid_seen_through_lags(order):
    """A closed form of its own: p the fastest way there, y by the gamma density of the lags."""
    length, V, A = 0.3, LIMITS.velocity, LIMITS.acceleration
    eta = streamed(order, np.full(1200, length))[:, 0, 0]
    ramp, cruise = V / A, length / V - V / A
    end = 2.0 * ramp + cruise

    def place(time):
        if time <= 0.0:
            return 0.0
        if time < ramp:
            return A * time**2 / 2.0
        if time < ramp + cruise:
            return V * (time - ramp / 2.0)
        return length - A * max(end - time, 0.0) ** 2 / 2.0

    delay = gamma(order, scale=1.0 / LIMITS.bandwidth)
    for k in (100, 300, 600, 900, 1199):
        time = k * PERIOD
        breaks = [t for t in (time - ramp, time - ramp - cruise, time - end) if t > 0.0]
        expected, _ = quad(
            lambda s, t=time: place(t - s) * delay.pdf(s), 0.0, time, points=breaks, limit=200
        )
        # in the last ticks it stops a little more gently than it could
        assert eta[k] == pytest.approx(expected, abs=2.0 * V * PERIOD)


def test_a_speed_that_is_asked_for_is_kept_and_nothing_stops_it_abruptly():
    speeds = np.full(2000, 0.4)
    speeds[600:1000], speeds[1000:1300], speeds[1300:1600] = 0.1, np.nan, 7.0
    eta = streamed(2, np.full(2000, 10.0), speeds)[:, :, 0]
    assert eta[599, 1] == pytest.approx(0.4, rel=1e-3)
    assert eta[999, 1] == pytest.approx(0.1, rel=0.02)
    assert eta[1299, 1] == pytest.approx(0.0, abs=1e-2)
    assert eta[:, 1].max() <= 0.4 * (1.0 + 1e-9)
    assert np.abs(eta[:, 2]).max() <= LIMITS.acceleration * (1.0 + 1e-9)


def test_way_points_beyond_the_end_of_the_path_are_its_end():
    eta = streamed(2, np.full(3000, 5.0), start=0.1, end=0.4)[:, :, 0]
    assert eta[0, 0] == 0.1
    assert eta[:, 0].max() <= 0.4
    assert eta[-1, 0] == pytest.approx(0.4, abs=1e-6)


def test_it_is_nearly_as_quick_as_a_motion_that_knows_its_end():
    """The lags cost their sum, and some more of what was planned as smooth from the start."""
    planned = rest_to_rest([0.0, 0.5], velocity=0.4, acceleration=2.0)
    eta = streamed(4, np.full(4000, 0.5))[:, 0, 0]
    arrived = PERIOD * np.flatnonzero(eta > 0.499)[0]
    assert arrived < planned.domain[1] + 8.0 / LIMITS.bandwidth


@pytest.mark.parametrize("key", ["velocity", "acceleration", "bandwidth"])
def test_limits_that_are_none_are_refused(key):
    with pytest.raises(InputError, match=f"{key} = 0"):
        StreamLimits(**{key: 0.0})
