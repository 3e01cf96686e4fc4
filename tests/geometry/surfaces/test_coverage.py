"""Where points leave a rectangle uncovered."""

import itertools

import numpy as np
import pytest

from pfsc_drake.geometry.surfaces.choose_base import _largest_rectangle, cover, stand
from pfsc_drake.geometry.surfaces.parametric_surface import Interval

SIDES = Interval(0.0, 1.0), Interval(2.0, 2.5)


def test_the_largest_rectangle_is_that_of_trying_all():
    rng = np.random.default_rng(1)
    for _ in range(40):
        mask = rng.random((6, 7)) < 0.7
        rows, columns = _largest_rectangle(mask)
        assert mask[slice(*rows), slice(*columns)].all()
        ends = itertools.product(
            itertools.combinations(range(7), 2), itertools.combinations(range(8), 2)
        )
        best = max(
            (r[1] - r[0]) * (c[1] - c[0]) for r, c in ends if mask[slice(*r), slice(*c)].all()
        )
        assert (rows[1] - rows[0]) * (columns[1] - columns[0]) == best


@pytest.mark.parametrize("closed", [False, True])
def test_holes_are_measured_across_seams(closed):
    rng = np.random.default_rng(2)
    theta = np.stack([rng.uniform(0.0, 1.0, 6000), rng.uniform(2.0, 2.5, 6000)], axis=1)
    theta = theta[np.hypot(theta[:, 0] - 0.02, theta[:, 1] - 2.25) > 0.1]
    theta = theta[np.hypot(theta[:, 0] - 1.02, theta[:, 1] - 2.25) > 0.1]
    coverage = cover(theta, SIDES, 0.05, closed=closed)
    centre, radius = coverage.hole
    np.testing.assert_allclose(centre, [0.02, 2.25], atol=0.02)
    np.testing.assert_allclose(radius, 0.1, atol=0.012)
    part = coverage.covered_rectangle(0.05, SIDES, closed)
    if closed:
        assert part[0] == SIDES[0]
        assert part[1].length < 0.25
    else:
        assert 0.02 < part[0].begin < 0.12 and part[0].end > 0.9 and part[1] == SIDES[1]


def test_nothing_covered_is_no_rectangle():
    coverage = cover(np.array([[0.5, 2.2]]), SIDES, 0.01, closed=True)
    assert coverage.covered_rectangle(0.01, SIDES, True) is None


def test_points_stand_as_they_do_over_most_of_the_area():
    """A grid of 0.1 m, and in one corner of it more points than in all the rest."""
    sides = np.linspace(0.0, 1.0, 11)
    grid = np.stack(np.meshgrid(sides, sides), axis=-1).reshape(-1, 2)
    cluster = np.random.default_rng(3).uniform(0.02, 0.08, (900, 2))
    diagonal = 0.1 * np.sqrt(2.0)
    assert stand(grid) == pytest.approx(diagonal)
    assert stand(np.concatenate([grid, cluster])) == pytest.approx(diagonal)
    # thrown at random: 1.8 / sqrt(density)
    thrown = np.random.default_rng(4).uniform(size=(4000, 2))
    assert stand(thrown) == pytest.approx(1.8 / np.sqrt(4000.0), rel=0.05)
