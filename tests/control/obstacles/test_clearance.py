"""Distances of an arm from obstacles, against distances of many points."""

import itertools

import numpy as np
import pytest

from pfsc_drake.control.obstacles.clearance import (
    Foresight,
    foresight_function,
    least_distances,
    nearness_function,
)
from pfsc_drake.control.obstacles.reach import Reach
from pfsc_drake.control.obstacles.shapes import Capsule, ObstacleShape

RADIUS, SPENT = 0.1, 0.15
FORESIGHT = Foresight(age=0.1, horizon=2.0, spread=0.0)
REACH = Reach(1.6, 6.0, 0.2)
BEAM = Capsule((-0.4, 0.1, 0.0), (0.5, 0.0, 0.3), 0.05)
SHAPES = {
    "sphere": ObstacleShape("sphere", 0.2),
    "column": ObstacleShape("column", 0.2),
    "person": ObstacleShape("person", 0.2),
    "capsules": ObstacleShape("capsules", 0.2, capsules=(BEAM, Capsule((0, 0, 1), (0, 0, 1), 0.3))),
}


def _line(a, b, count):
    return np.array(a) + np.linspace(0.0, 1.0, count)[:, None] * (np.array(b) - np.array(a))


def _sampled(arm, shape, position, count=150):
    """Least distance of many points of an arm from many points of an obstacle's lines."""
    points = np.vstack([_line(a, b, count) for a, b in itertools.pairwise(arm)])
    axes, least = shape.axes.full().ravel(), np.inf
    for part in shape.parts:
        line = position + _line(part.start, part.end, 1 if part.is_sphere else count)
        away = (points[:, None] - line[None]) * axes
        least = min(least, np.linalg.norm(away, axis=2).min() - part.radius)
    return least - RADIUS


@pytest.mark.slow(but=["sphere", "column"])
@pytest.mark.parametrize("kind", SHAPES)
def test_distances_are_those_of_many_points(kind):
    rng, shape = np.random.default_rng(2), SHAPES[kind]
    nearness = nearness_function([shape], REACH, SPENT, 4, RADIUS)
    foresight = foresight_function([shape], FORESIGHT, 4, RADIUS)
    for _ in range(8):
        arm, p, v = rng.normal(size=(4, 3)), rng.normal(size=3), rng.normal(size=3)
        state = np.append(p, v)
        near = float(nearness(arm.ravel(), state)[0])
        assert near == pytest.approx(_sampled(arm, shape, p), abs=5e-3)
        # the function for logs uses another method
        found = least_distances(arm.reshape(1, -1), p[None], [shape], RADIUS)
        assert found[0, 0] == pytest.approx(near, abs=1e-9)
        times = 0.1 + np.linspace(0.5, 2.0, 60)
        swept = min(_sampled(arm, shape, p + v * t, 60) for t in times)
        assert float(foresight(arm.ravel(), state, 0.5)) == pytest.approx(swept, abs=0.03)


@pytest.mark.parametrize("kind", SHAPES)
def test_an_obstacle_that_moves_is_not_near_before_its_time(kind):
    """The obstacle continues as measured, or reverses towards the nearest point of the arm."""
    rng, shape = np.random.default_rng(3), SHAPES[kind]
    nearness = nearness_function([shape], REACH, SPENT, 3, RADIUS)
    arm = np.array([[0.0, 0, 0], [0.3, 0, 0.5], [0.8, 0, 0.6]])
    axes = shape.axes.full().ravel()
    for _ in range(8):
        p, v = axes * rng.normal(scale=2.0, size=3), axes * rng.normal(size=3)
        v *= rng.uniform(0.2, 1.6) / np.linalg.norm(v)
        near, until = (float(x) for x in nearness(arm.ravel(), np.append(p, v)))
        if near <= SPENT:
            assert until <= 0.0
            continue
        for t in np.linspace(0.0, until, 15):
            straight = p + t * v
            goal = axes * (np.array([0.4, 0.0, 0.4]) - p)
            goal *= 6.0 / np.linalg.norm(goal)
            assert _sampled(arm, shape, straight, 60) >= SPENT - 0.02
            if np.linalg.norm(v + t * goal) <= 1.6:
                assert _sampled(arm, shape, straight + t**2 * goal / 2.0, 60) >= SPENT - 0.02


def test_time_depends_on_margin_and_velocity():
    arm = np.array([0.0, 0, -1, 0, 0, 1])
    nearness = nearness_function([SHAPES["sphere"]], REACH, SPENT, 2, RADIUS)
    for v, x in itertools.product((-1.0, 0.0, 1.0), (0.7, 2.5)):
        near, until = nearness(arm, np.array([x, 0, 0, v, 0.7, 0.7]))
        assert float(near) == pytest.approx(x - 0.3)
        assert float(until) == pytest.approx(float(REACH.time(x - 0.3 - SPENT, v)))


def test_prediction_spreads_with_time_and_ends_at_the_horizon():
    shape, arm = ObstacleShape("sphere", 0.2), np.array([0.0, -1.0, 0.0, 0.0, 1.0, 0.0])
    spreading = Foresight(age=0.0, horizon=2.0, spread=0.1)
    foresight = foresight_function([shape], spreading, 2, RADIUS)
    # comes along x until 1 m before the arm
    state = np.array([3.0, 0.0, 0.0, -1.0, 0.0, 0.0])
    ahead = foresight(arm, state, 0.0)
    assert float(ahead) == pytest.approx(1.0 - 0.3 - 0.1 * 2.0)
    assert float(foresight(arm, state, 5.0)) == pytest.approx(float(ahead))
    # goes away: it is nearest when the arm arrives
    gone = foresight(arm, np.array([1.0, 0.0, 0.0, 1.0, 0.0, 0.0]), 1.0)
    assert float(gone) == pytest.approx(2.0 - 0.3 - 0.1 * 1.0)


def test_the_nearest_of_several_obstacles_counts():
    shapes = [SHAPES["sphere"], ObstacleShape("column", 0.3)]
    nearness = nearness_function(shapes, REACH, SPENT, 2, RADIUS)
    state = np.array([2.0, 0, 0, 0, 0, 0, 1.0, 0, 9.0, 0, 0, 0])
    near, until = nearness(np.zeros(6), state)
    assert float(near) == pytest.approx(1.0 - 0.4)
    assert float(until) == pytest.approx(float(REACH.time(0.6 - SPENT, 0.0)))
    # the nearer one leaves, the other one comes
    state[9] = 1.6
    state[3] = -1.6
    expected = min(float(REACH.time(0.6 - SPENT, 1.6)), float(REACH.time(1.7 - SPENT, -1.6)))
    assert float(nearness(np.zeros(6), state)[1]) == pytest.approx(expected)
