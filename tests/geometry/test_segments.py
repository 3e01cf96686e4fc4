"""Distances of segments against a search, and where they degenerate."""

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize

from pfsc_drake.geometry.segments import to_point, to_segment


def _searched(a, b, c, d):
    def distance(x):
        return np.linalg.norm(a + x[0] * (b - a) - c - x[1] * (d - c))

    starts = [(0.1, 0.1), (0.9, 0.1), (0.1, 0.9), (0.9, 0.9), (0.5, 0.5)]
    bounds = [(0.0, 1.0)] * 2
    return min(minimize(distance, x, bounds=bounds, tol=1e-12).fun for x in starts)


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
