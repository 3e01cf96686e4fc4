"""Distances of segments against a search, and where they degenerate."""

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize

from pfsc_drake.geometry.segments import (
    between_nearest,
    from_nearest,
    to_point,
    to_segment,
    to_swept,
)


def _searched(a, b, c, d):
    def distance(x):
        return np.linalg.norm(a + x[0] * (b - a) - c - x[1] * (d - c))

    starts = [(0.1, 0.1), (0.9, 0.1), (0.1, 0.9), (0.9, 0.9), (0.5, 0.5)]
    bounds = [(0.0, 1.0)] * 2
    return min(minimize(distance, x, bounds=bounds, tol=1e-12).fun for x in starts)


@pytest.mark.slow
def test_distances_are_the_least_that_a_search_finds():
    rng = np.random.default_rng(1)
    for _ in range(60):
        a, b, c, d = rng.normal(size=(4, 3))
        distance, share = (float(x) for x in to_segment(*map(ca.DM, (a, b, c, d))))
        assert distance == pytest.approx(_searched(a, b, c, d), abs=1e-6)
        there = c + share * (d - c)
        assert distance == pytest.approx(float(to_point(*map(ca.DM, (a, b, there)))), abs=1e-9)


@pytest.mark.parametrize(
    ("ends", "expected"),
    [
        (([0, 0], [1, 0], [0.2, 1], [0.8, 1]), 1.0),  # side by side
        (([0, 0], [1, 0], [2, 0], [3, 0]), 1.0),  # one behind the other
        (([0, 0], [1, 0], [2, 1], [2, 1]), 2**0.5),  # a point
        (([0, 0], [0, 0], [3, 4], [3, 4]), 5.0),  # two points
        (([0, 0], [2, 2], [0, 2], [2, 0]), 0.0),  # a cross
    ],
)
def test_degenerate_segments(ends, expected):
    distance, _ = to_segment(*[ca.DM(end) for end in ends])
    assert float(distance) == pytest.approx(expected, abs=1e-9)
    a, b, c, _ = (np.array(end, dtype=float) for end in ends)
    places = a + np.linspace(0, 1, 20001)[:, None] * (b - a)
    least = np.linalg.norm(places - c, axis=1).min()
    assert float(to_point(*map(ca.DM, (a, b, c)))) == pytest.approx(least, abs=1e-4)


def test_vectors_lead_from_the_closest_point():
    rng = np.random.default_rng(2)
    for _ in range(20):
        a, b, c, d = (ca.DM(end) for end in rng.normal(size=(4, 3)))
        away, share = between_nearest(a, b, c, d)
        there = c + share * (d - c)
        # from the second one to the first, and the other way round from the place on the second
        np.testing.assert_allclose(away.full(), -from_nearest(a, b, there).full(), atol=1e-9)


def _swept(a, b, c, d, way):
    """Least distance and where, by a search over both segments and the way."""

    def squared(x):
        return np.sum((a + x[0] * (b - a) - c - x[1] * (d - c) - x[2] * way) ** 2)

    starts = np.array(np.meshgrid(*[[0.1, 0.9]] * 3)).reshape(3, -1).T
    found = [minimize(squared, x, bounds=[(0.0, 1.0)] * 3, tol=1e-14) for x in starts]
    best = min(found, key=lambda result: result.fun)
    return np.sqrt(best.fun), best.x[2]


@pytest.mark.slow(but="2.0")
@pytest.mark.parametrize("away", [0.0, 0.5, 2.0])
def test_what_a_segment_sweeps_is_as_far_as_a_search_finds(away):
    """Through it, over its inside, and beside it."""
    rng = np.random.default_rng(3)
    for _ in range(25):
        a, b, c, d, way = rng.normal(size=(5, 3))
        a, b = 0.5 * a + away, 0.5 * b + away
        distance, when = (float(x) for x in to_swept(*map(ca.DM, (a, b, c, d, way))))
        expected, share = _swept(a, b, c, d, way)
        assert distance == pytest.approx(expected, abs=1e-5)
        if distance > 1e-3:
            assert when == pytest.approx(share, abs=1e-2)


def test_over_the_inside_of_what_is_swept():
    square = ([0.0, 0, 0], [2.0, 0, 0], [0, 2.0, 0])
    over = to_swept(ca.DM([0.5, 1.5, 0.3]), ca.DM([0.5, 1.5, 1.0]), *map(ca.DM, square))
    assert [float(x) for x in over] == pytest.approx([0.3, 0.75])
    through = to_swept(ca.DM([0.5, 0.5, -3.0]), ca.DM([0.5, 0.5, 1.0]), *map(ca.DM, square))
    assert [float(x) for x in through] == pytest.approx([0.0, 0.25])
    # it does not move, and it moves along itself
    still = to_swept(ca.DM([0, 1.0, 0]), ca.DM([2.0, 1, 0]), *map(ca.DM, (*square[:2], [0, 0, 0])))
    assert float(still[0]) == pytest.approx(1.0)
    along = to_swept(ca.DM([3.0, 1, 0]), ca.DM([3.0, 2, 0]), *map(ca.DM, (*square[:2], [1, 0, 0])))
    assert [float(x) for x in along] == pytest.approx([1.0, 1.0])
