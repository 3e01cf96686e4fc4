"""Tensor-product splines as surfaces."""

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.surfaces.grid import smooth_surface_near_grid, surface_through_grid
from pfsc_drake.geometry.surfaces.parametric_surface import (
    partial_count,
    partial_index,
    partial_orders,
)
from pfsc_drake.geometry.surfaces.product import (
    UniformKnots,
    interpolated_surface,
    uniform_spline_surface,
)

RNG = np.random.default_rng(5)


def random_surface(degree=6, closed=(False, False)):
    first = UniformKnots(-0.1, 0.5, 5, degree, closed[0])
    second = UniformKnots(0.2, 0.6, 7, degree, closed[1])
    return uniform_spline_surface(first, second, RNG.normal(size=(first.count, second.count, 3)))


def test_polynomials_of_the_degree_are_reproduced():
    powers = RNG.normal(size=(7, 7, 3))
    u, v = np.sort(RNG.uniform(0.0, 1.0, 9)), np.sort(RNG.uniform(0.0, 1.0, 11))
    table = np.polynomial.polynomial.polygrid2d(u, v, powers)
    surface = interpolated_surface((u, v), np.moveaxis(table, 0, -1), 6, (False, False))
    theta = np.stack([RNG.uniform(u[0], u[-1], 50), RNG.uniform(v[0], v[-1], 50)], axis=1)
    rows = surface.partials(theta, 3)
    for i, j in partial_orders(3):
        derived = np.polynomial.polynomial.polyder(powers, i, axis=0)
        derived = np.polynomial.polynomial.polyder(derived, j, axis=1)
        expected = np.polynomial.polynomial.polyval2d(*theta.T, derived).T
        scale = np.abs(expected).max()
        found = rows[:, partial_index(i, j)]
        np.testing.assert_allclose(found, expected, atol=1e-6 * scale)
        if i + j == 0:
            np.testing.assert_allclose(found, expected, atol=1e-12 * scale)


def test_partials_are_those_of_differences():
    surface = random_surface()
    theta, step = np.array([0.173, 0.431]), 1e-4
    exact = surface.partials(theta, 6)
    for i, j in partial_orders(5):
        for axis, (up, over) in enumerate([(i + 1, j), (i, j + 1)]):
            shift = step * np.eye(2)[axis]
            row = partial_index(i, j)
            ahead, behind = (surface.partials(theta + s * shift, 5)[row] for s in (1, -1))
            slope = (ahead - behind) / (2.0 * step)
            scale = np.abs(exact[partial_index(up, over)]).max()
            np.testing.assert_allclose(slope, exact[partial_index(up, over)], atol=2e-4 * scale)


@pytest.mark.parametrize("closed", [(False, False), (True, False), (False, True), (True, True)])
@pytest.mark.parametrize("degree", [3, 6])
def test_partials_below_the_degree_are_continuous(closed, degree):
    surface = random_surface(degree, closed)
    assert surface.smoothness == degree - 1
    for axis in (0, 1):
        breaks = surface.breakpoints[axis]
        length = breaks[-1] - breaks[0]
        places = breaks if closed[axis] else breaks[1:-1]
        theta = np.full((len(places), 2), [0.131, 0.287])
        theta[:, axis] = places
        shift = 1e-9 * length * np.eye(2)[axis]
        before, after = (surface.partials(theta + s * shift, degree) for s in (-1.0, 1.0))
        for i, j in partial_orders(degree):
            row = partial_index(i, j)
            jump = np.abs(after - before)[:, row].max()
            scale = np.abs(before[:, row]).max()
            if i + j < degree:
                assert jump < 1e-6 * scale, (i, j)
            elif (i, j)[axis] == degree:
                assert jump > 1e-3 * scale


def test_the_fast_form_agrees_and_wraps():
    surface = random_surface(closed=(True, False))
    sample = surface.flat_sampler(5)
    for theta_1 in (-0.1, 0.07, 0.499, 0.63, -0.9):
        rows = sample(theta_1, 0.41).reshape(partial_count(5), 3)
        np.testing.assert_allclose(rows, surface.partials([theta_1, 0.41], 5), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(sample(0.63, 0.3), sample(0.03, 0.3), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("closed", [(True, False), (False, True), (True, True)])
def test_a_closed_grid_does_not_show_where_it_begins(closed):
    # a torus whose points stand at equal distances
    grid = torus(12, 11, closed)
    rolled = np.roll(grid, [3 * around for around in closed], axis=(0, 1))
    one = surface_through_grid(grid, smoothness=5, closed=closed)
    two = surface_through_grid(rolled, smoothness=5, closed=closed)
    theta = np.stack([RNG.uniform(*side, 30) for side in one.domain], axis=1)
    steps = [
        3.0 * side.length / count * around
        for side, count, around in zip(one.domain, grid.shape[:2], closed, strict=True)
    ]
    found, other = one.partials(theta, 4), two.partials(theta + steps, 4)
    scale = np.abs(found).max(axis=(0, 2))
    assert np.all(np.abs(found - other).max(axis=(0, 2)) < 1e-8 * scale)


def torus(count_1, count_2, closed, noise=0.0):
    """Points of a torus of radii 0.3 and 0.1, or of a part of it."""
    turns = [
        np.arange(n) / n * (1.0 if c else 0.3)
        for n, c in zip((count_1, count_2), closed, strict=True)
    ]
    a, b = np.meshgrid(*(2.0 * np.pi * turn for turn in turns), indexing="ij")
    rho = 0.3 + 0.1 * np.cos(b)
    grid = np.stack([rho * np.cos(a), rho * np.sin(a), 0.1 * np.sin(b)], axis=-1)
    return grid + noise * np.random.default_rng(2).normal(size=grid.shape)


def off_torus(surface):
    """Distances of a surface's points from the torus, m."""
    theta = np.stack(np.meshgrid(*(np.linspace(*side, 80) for side in surface.domain)), axis=-1)
    x, y, z = np.moveaxis(surface.partials(theta, 0)[..., 0, :], -1, 0)
    return np.hypot(np.hypot(x, y) - 0.3, z) - 0.1


def test_a_surface_goes_through_its_grid_with_tangents_of_length_one():
    grid = torus(24, 20, (True, True))
    surface = surface_through_grid(grid, smoothness=5, closed=(True, True))
    sides = [
        np.arange(n) / n * side.length for n, side in zip((24, 20), surface.domain, strict=True)
    ]
    theta = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1)
    rows = surface.partials(theta, 1)
    np.testing.assert_allclose(rows[..., 0, :], grid, atol=1e-13)
    assert np.abs(off_torus(surface)).max() < 2e-7
    np.testing.assert_allclose(np.linalg.norm(rows[..., 2, :], axis=-1), 1.0, atol=0.01)
    np.testing.assert_allclose(np.linalg.norm(rows[..., 1, :], axis=-1).mean(), 1.0, atol=0.02)


@pytest.mark.slow(but="None")
@pytest.mark.parametrize("tolerance", [None, 3e-4, 5e-4])
def test_a_smooth_surface_is_nearer_to_the_truth_than_its_noisy_points(tolerance):
    grid = torus(30, 20, (True, True), 1e-4)
    surface, left = smooth_surface_near_grid(
        grid, smoothness=5, tolerance=tolerance, closed=(True, True)
    )
    assert surface.smoothness == 5 and surface.closed == (True, True)
    truth = off_torus(surface)
    if tolerance is None:
        assert 0.9e-4 < left.rms < 1.05e-4
        assert np.sqrt(np.mean(truth**2)) < 4e-5 and np.abs(truth).max() < 1.5e-4
    else:
        assert left.largest <= tolerance
        assert np.abs(truth).max() < tolerance


def test_a_tolerance_below_the_noise_is_refused_with_one_that_will_do():
    grid = torus(30, 20, (True, True), 1e-4)
    with pytest.raises(InputError, match=r"tolerance: 5e-05 m: .* allow 0\.000\d+ m"):
        smooth_surface_near_grid(grid, smoothness=5, tolerance=5e-5, closed=(True, True))


def flat(rows=9, columns=8):
    return np.stack(
        [
            *np.meshgrid(np.arange(rows) * 0.01, np.arange(columns) * 0.01, indexing="ij"),
            np.zeros((rows, columns)),
        ],
        axis=-1,
    )


def with_value(place, value):
    grid = flat()
    grid[place] = value
    return grid


@pytest.mark.parametrize(
    ("grid", "reason"),
    [
        (flat()[:, :, :2], r"shape \(9, 8, 2\)"),
        (flat(rows=6), "6 along theta_1, an open direction; 7 are needed"),
        (with_value((3, 4, 2), np.nan), "row 4, column 5, z = nan m"),
        (with_value((3, 4, 0), 1e5), r"row 4, column 5, x = 100000 m"),
        (with_value((3, 4), [0.03, 0.03, 0.0]), "row 4, column 4 coincides .* theta_2"),
        (1e-4 * flat(), "at least 0.0001 m"),
        (with_value(slice(5, 7), flat()[[6, 5]]), "normal flips|not regular"),
    ],
)
def test_grids_that_make_no_surface_are_refused(grid, reason):
    with pytest.raises(InputError, match=reason):
        surface_through_grid(grid, smoothness=5)
