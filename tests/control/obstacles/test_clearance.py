"""How far an arm is from obstacles, against distances of many points."""

import itertools

import numpy as np
import pytest

from pfsc_drake.control.obstacles.clearance import (
    Foresight,
    ObstacleShape,
    clearance_function,
    least_distances,
)
from pfsc_drake.errors import InputError

RADIUS = 0.1
FORESIGHT = Foresight(age=0.1, horizon=2.0, spread=0.0)


def _points(arm, count=400):
    """Return many points on the axes of an arm."""
    shares = np.linspace(0.0, 1.0, count)[:, None]
    return np.vstack([a + shares * (b - a) for a, b in itertools.pairwise(arm)])


def _sampled(arm, shape, position):
    away = (_points(arm) - position) * shape.axes.full().ravel()
    return np.linalg.norm(away, axis=1).min() - shape.radius - RADIUS


@pytest.mark.parametrize("kind", ["sphere", "column"])
def test_distances_are_those_of_many_points(kind):
    rng, shape = np.random.default_rng(2), ObstacleShape(kind, 0.2)
    clearance = clearance_function([shape], FORESIGHT, 4, RADIUS)
    for _ in range(10):
        arm, p, v = rng.normal(size=(4, 3)), rng.normal(size=3), rng.normal(size=3)
        near, ahead = (float(x) for x in clearance(arm.ravel(), np.append(p, v), 0.5))
        assert near == pytest.approx(_sampled(arm, shape, p), abs=2e-3)
        found = least_distances(arm.reshape(1, -1), p[None], [shape], RADIUS)
        assert found[0, 0] == pytest.approx(near, abs=1e-12)
        times = 0.1 + np.linspace(0.5, 2.0, 200)
        swept = min(_sampled(arm, shape, p + v * t) for t in times)
        assert ahead == pytest.approx(swept, abs=0.02)


def test_what_is_expected_spreads_with_time_and_ends_at_the_horizon():
    shape, arm = ObstacleShape("sphere", 0.2), np.array([0.0, -1.0, 0.0, 0.0, 1.0, 0.0])
    spreading = Foresight(age=0.0, horizon=2.0, spread=0.1)
    clearance = clearance_function([shape], spreading, 2, RADIUS)
    # comes along x until 1 m before the arm
    state = np.array([3.0, 0.0, 0.0, -1.0, 0.0, 0.0])
    _, ahead = clearance(arm, state, 0.0)
    assert float(ahead) == pytest.approx(1.0 - 0.3 - 0.1 * 2.0)
    _, late = clearance(arm, state, 5.0)
    assert float(late) == pytest.approx(float(ahead))
    # goes away: it is nearest when the arm arrives
    _, gone = clearance(arm, np.array([1.0, 0.0, 0.0, 1.0, 0.0, 0.0]), 1.0)
    assert float(gone) == pytest.approx(2.0 - 0.3 - 0.1 * 1.0)


def test_the_nearest_of_several_obstacles_counts():
    shapes = [ObstacleShape("sphere", 0.2), ObstacleShape("column", 0.3)]
    clearance = clearance_function(shapes, FORESIGHT, 2, RADIUS)
    state = np.array([2.0, 0, 0, 0, 0, 0, 1.0, 0, 9.0, 0, 0, 0])
    near, _ = clearance(np.zeros(6), state, 0.0)
    assert float(near) == pytest.approx(1.0 - 0.4)


def test_shapes_that_are_none_are_refused():
    with pytest.raises(InputError, match="kind"):
        ObstacleShape("cube", 0.2)
    with pytest.raises(InputError, match="radius"):
        ObstacleShape("sphere", 0.0)
