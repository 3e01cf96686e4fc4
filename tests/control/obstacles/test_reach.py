"""Earliest arrival of an obstacle, against obstacles that take the fastest motion."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pfsc_drake.control.obstacles.reach import Reach

V, A = 1.6, 4.0
REACH = Reach(V, A, 0.0)


@pytest.mark.slow(but=["0.01-0.4", "0.01--1.6", "0.2-0.0", "0.2--0.7", "0.9-1.6", "0.9--0.7"])
@pytest.mark.parametrize("receding", [-1.6, -0.7, 0.0, 0.4, 1.6])
@pytest.mark.parametrize("gap", [0.01, 0.2, 0.9])
def test_time_is_that_of_an_obstacle_that_reverses_at_its_limits(gap, receding):
    def rates(_, x):
        return [x[1], 0.0 if x[1] <= -V else -A]

    def arrives(_, x):
        return x[0]

    arrives.terminal, arrives.direction = True, -1
    found = solve_ivp(rates, (0.0, 10.0), [gap, receding], events=arrives, max_step=1e-3)
    assert float(REACH.time(gap, receding)) == pytest.approx(found.t_events[0][0], abs=2e-3)


@pytest.mark.slow
def test_no_obstacle_within_its_bounds_arrives_sooner():
    """Points in space that accelerate at random, from a line: its distance is convex."""
    rng, step = np.random.default_rng(4), 2e-3
    nearest = np.inf
    for _ in range(200):
        p, v = np.array([rng.uniform(0.2, 0.6), 0.0, 0.0]), rng.normal(size=3)
        v *= rng.uniform(0.0, V) / np.linalg.norm(v)
        start = p.copy()
        earliest, t = float(REACH.time(p[0], v[0])), 0.0
        goal = np.append(0.0, rng.normal(scale=0.2, size=2))
        while np.hypot(p[0], max(abs(p[1]) - 1.0, 0.0)) > 1e-3 and t < 3.0:
            a = goal - p
            a *= A / max(np.linalg.norm(a), 1e-9)
            v = v + step * a
            v *= min(1.0, V / max(np.linalg.norm(v), 1e-9))
            p, t = p + step * v, t + step
        nearest = min(nearest, t - earliest)
        assert t >= earliest - 3.0 * step, start
    assert nearest < 0.05


def test_velocities_are_ignored_without_an_acceleration_limit():
    blind = Reach(V, None, 0.3)
    for receding in (-1.0, 0.0, 1.0):
        assert float(blind.time(0.8, receding)) == pytest.approx(0.5)
        # unlimited acceleration
        assert float(Reach(V, 1e9, 0.3).time(0.8, receding)) == pytest.approx(0.5, abs=1e-6)


def test_velocity_uncertainty_reduces_the_time():
    for receding in (-1.6, -0.5, 0.3):
        assert float(Reach(V, A, 0.3).time(0.4, receding)) == float(
            REACH.time(0.4, max(receding - 0.3, -V))
        )


def test_no_gap_leaves_no_time():
    times = [float(REACH.time(gap, 1.0)) for gap in (-0.1, 0.0, 1e-9)]
    assert times[0] < 0.0
    assert times[1] == 0.0
    assert times[2] > 0.0
