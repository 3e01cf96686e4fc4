"""Surfaces fitted to scattered points."""

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.surfaces.choose_base import Axis
from pfsc_drake.geometry.surfaces.scattered import ScatteredFitOptions, fit_scattered

NOISE = 1e-4
R = np.linalg.qr(np.random.default_rng(11).normal(size=(3, 3)))[0]
R *= np.sign(np.linalg.det(R))
ORIGIN = np.array([0.6, -0.2, 0.4])


def height(x, y):
    """A workpiece with slopes of up to 18 degrees and radii of down to 0.14 m."""
    return 0.02 * np.sin(8.0 * x) * np.cos(6.0 * y) + 0.25 * x**2


def off_workpiece(points):
    """Distances from the true workpiece, to first order, m."""
    x, y, z = np.moveaxis((points - ORIGIN) @ R, -1, 0)
    slope_x = 0.16 * np.cos(8.0 * x) * np.cos(6.0 * y) + 0.5 * x
    slope_y = -0.12 * np.sin(8.0 * x) * np.sin(6.0 * y)
    return (z - height(x, y)) / np.sqrt(1.0 + slope_x**2 + slope_y**2)


def workpiece(count=2000, noise=NOISE, seed=1):
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-0.2, 0.2, count), rng.uniform(-0.15, 0.15, count)
    points = np.stack([x, y, height(x, y)], axis=1) @ R.T + ORIGIN
    return points + noise * rng.normal(size=points.shape)


def flat_place(points):
    return (points - ORIGIN) @ R


def tube(span, count=1500, noise=NOISE, radius=0.1):
    """Points of a cylinder about y."""
    rng = np.random.default_rng(2)
    a, y = rng.uniform(-span / 2.0, span / 2.0, count), rng.uniform(0.0, 0.25, count)
    points = np.stack([radius * np.cos(a), y, radius * np.sin(a)], axis=1)
    return points + noise * rng.normal(size=points.shape)


def samples(surface, count=101):
    sides = [np.linspace(*side, count) for side in surface.domain]
    theta = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 2)
    return surface.partials(theta, 1)


def rms(values):
    return np.sqrt(np.mean(values**2))


@pytest.fixture(scope="module")
def scanned():
    return fit_scattered(workpiece())


def test_the_surface_is_within_the_noise_of_the_true_workpiece(scanned):
    truth = off_workpiece(samples(scanned.surface)[:, 0])
    assert rms(truth) < 0.2 * NOISE
    assert np.abs(truth).max() < 1.5 * NOISE
    assert scanned.surface.smoothness == 5
    assert scanned.base == "a plane"


@pytest.mark.slow
def test_residuals_are_the_noise_along_the_normal(scanned):
    points, left = scanned.points, scanned.residuals
    np.testing.assert_allclose(scanned.noise, NOISE, rtol=0.04)
    assert rms(left.distances - off_workpiece(points) * np.sign(R[2, 2])) < 0.2 * NOISE
    rows = scanned.surface.partials(left.theta, 1)
    normals = np.cross(rows[:, 1], rows[:, 2])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    ends = np.array(scanned.surface.domain).T
    inside = np.all((left.theta > ends[0]) & (left.theta < ends[1]), axis=1)
    closest_points = rows[:, 0] + left.distances[:, None] * normals
    np.testing.assert_allclose(closest_points[inside], points[inside], atol=1e-10)


def test_the_uncertainty_stated_is_that_of_the_error(scanned):
    assert 0.5 * scanned.uncertainty < np.abs(off_workpiece(samples(scanned.surface)[:, 0])).max()
    assert np.abs(off_workpiece(samples(scanned.surface)[:, 0])).max() < 4.0 * scanned.uncertainty


@pytest.mark.slow
def test_points_without_noise_are_met():
    fit = fit_scattered(workpiece(noise=0.0))
    assert np.abs(off_workpiece(samples(fit.surface)[:, 0])).max() < 1e-7
    assert fit.residuals.largest < 1e-9


def test_few_points_of_a_quadric_suffice():
    rng = np.random.default_rng(4)
    x, y = rng.uniform(-0.1, 0.1, (2, 400))
    points = np.stack([x, y, 0.3 * x**2 - 0.2 * x * y + 0.1 * y**2 + 0.05 * x], axis=1)
    fit = fit_scattered(points, ScatteredFitOptions(smoothness=3))
    x, y, z = samples(fit.surface)[:, 0].T
    np.testing.assert_allclose(z, 0.3 * x**2 - 0.2 * x * y + 0.1 * y**2 + 0.05 * x, atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("tolerance", [3.5e-4, 1e-3])
def test_no_point_is_missed_by_more_than_the_tolerance(tolerance, scanned):
    fit = fit_scattered(workpiece(), ScatteredFitOptions(tolerance=tolerance))
    assert fit.residuals.largest <= tolerance
    assert np.abs(off_workpiece(samples(fit.surface)[:, 0])).max() < 1.5 * tolerance
    assert roughness(fit.surface) < 1.05 * roughness(scanned.surface)


def roughness(surface):
    """Mean square of the fourth derivatives."""
    sides = [np.linspace(*side, 60) for side in surface.domain]
    theta = np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 2)
    return float(np.mean(surface.partials(theta, 4)[:, 10:] ** 2))


@pytest.mark.slow(but="6.283185307179586")
@pytest.mark.parametrize("span", [2.0, 4.0, 2.0 * np.pi])
def test_points_that_bend_over_are_projected_from_their_axis(span):
    fit = fit_scattered(tube(span))
    assert fit.base == "a cylinder"
    assert fit.surface.closed == (span > 6.0, False)
    rows = samples(fit.surface)
    radius = np.hypot(rows[:, 0, 0], rows[:, 0, 2])
    assert np.abs(radius - 0.1).max() < 0.7 * NOISE
    np.testing.assert_allclose(np.linalg.norm(rows[:, 1], axis=1), 1.0, atol=0.01)
    outward = np.sum(np.cross(rows[:, 1], rows[:, 2]) * rows[:, 0] * [1, 0, 1], axis=1)
    assert np.all(outward > 0.0)


@pytest.mark.slow
def test_the_normal_points_to_where_the_surface_is_seen_from():
    inside = ScatteredFitOptions(visible_from=[0.01, 0.1, 0.0])
    rows = samples(fit_scattered(tube(2.0 * np.pi), inside).surface)
    assert np.all(np.sum(np.cross(rows[:, 1], rows[:, 2]) * rows[:, 0] * [1, 0, 1], axis=1) < 0.0)
    below = ScatteredFitOptions(visible_from=ORIGIN - np.sign(R[2, 2]) * R[:, 2])
    rows = samples(fit_scattered(workpiece(500), below).surface)
    assert np.all(np.sign(R[2, 2]) * np.cross(rows[:, 1], rows[:, 2]) @ R[:, 2] < 0.0)


@pytest.mark.slow
def test_a_given_axis_and_direction_are_used():
    fit = fit_scattered(tube(1.0), ScatteredFitOptions(base=Axis([0.0, 0.0, 0.0], [0.0, 1.0, 0.0])))
    assert fit.base == "a cylinder"
    rows = samples(fit.surface)
    np.testing.assert_allclose(rows[:, 2] @ [0.0, 1.0, 0.0], 1.0, atol=1e-9)
    fit = fit_scattered(workpiece(500), ScatteredFitOptions(along=R[:, 1]))
    assert np.all(samples(fit.surface)[:, 1] @ R[:, 1] > 0.99)


def with_hole():
    points = workpiece()
    x, y, _ = flat_place(points).T
    return points[np.hypot(x - 0.05, y) > 0.04]


def test_a_hole_is_found_where_it_is():
    with pytest.raises(InputError, match=r"no point within 0.0[34]\d* m of theta") as error:
        fit_scattered(with_hole())
    text = str(error.value)
    near = [float(t) for t in text.split("the point [")[1].split("]")[0].split(",")]
    x, y, _ = flat_place(np.array(near))
    np.testing.assert_allclose(np.hypot(x - 0.05, y), 0.04, atol=0.004)


def test_a_patch_is_trimmed_to_what_is_covered():
    fit = fit_scattered(with_hole(), ScatteredFitOptions(trim=True))
    found = samples(fit.surface)[:, 0]
    x, y, _ = flat_place(found).T
    assert np.hypot(x - 0.05, y).min() > 0.004
    assert fit.surface.domain[0].length * fit.surface.domain[1].length > 0.25 * 0.12
    assert np.abs(off_workpiece(found)).max() < 2.0 * NOISE
    assert fit.hole < 0.04


@pytest.mark.slow
def test_a_hole_that_is_allowed_is_bridged():
    fit = fit_scattered(with_hole(), ScatteredFitOptions(largest_hole=0.05))
    assert np.abs(off_workpiece(samples(fit.surface)[:, 0])).max() < 3.0 * NOISE


def sheets(gap, count=2000):
    points = workpiece(count)
    points[::2] += gap * R[:, 2]
    return points


def sphere():
    points = np.random.default_rng(3).normal(size=(2000, 3))
    return 0.1 * points / np.linalg.norm(points, axis=1, keepdims=True)


def changed(row, value):
    points = workpiece(500)
    points[row] = value
    return points


@pytest.mark.parametrize(
    ("points", "options", "reason"),
    [
        (sheets(0.05, 4000), {}, "folds over: on a plane two sheets lie over each other near"),
        pytest.param(sheets(0.008), {}, "single sheet", marks=pytest.mark.slow),
        (tube(6.0), {"base": "plane"}, "folds over: on a plane"),
        (sphere(), {}, "do not determine the surface|leans over|folds over"),
        (np.linspace(0.0, 1.0, 200)[:, None] * [1.0, 0.5, 0.2], {}, "along one line"),
        (changed(7, workpiece(500)[7] + 0.01 * R[:, 2]), {}, "number 8 .* is 0.00.* m away"),
        (workpiece(), {"tolerance": 1e-4}, r"tolerance: 0.0001 m: .* allow 0.000\d+ m"),
        (changed(3, [0.1, np.nan, 0.0]), {}, "number 4, y = nan m"),
        (changed(3, [0.1, 0.0, 2e4]), {}, "number 4, z = 20000 m"),
        (changed(9, workpiece(500)[2]), {}, "numbers 3 and 10 are the same"),
        (workpiece(40), {}, "40; from 50 to 100000"),
        (workpiece(60)[:, :2], {}, r"shape \(60, 2\)"),
        (1e-5 * workpiece(60), {}, "at least 0.0001 m"),
        (workpiece(60), {"tolerance": -1.0}, "tolerance: -1.0 m; a positive number"),
        (workpiece(60), {"largest_hole": np.nan}, "largest_hole: nan m"),
        (workpiece(60), {"base": "sphere"}, "'sphere'; 'auto', 'plane', 'cylinder'"),
        (workpiece(60), {"smoothness": 9}, "smoothness: 9"),
        (workpiece(60), {"visible_from": [0.0, 1.0]}, "visible_from"),
    ],
)
def test_points_that_make_no_surface_are_refused(points, options, reason):
    with pytest.raises(InputError, match=reason):
        fit_scattered(points, ScatteredFitOptions(**options))


def test_noise_is_that_along_the_normal_where_the_patch_is_steep():
    """Up to 58 degrees: heights over the base scatter by up to 1.9 times as much."""
    rng = np.random.default_rng(5)
    x, y = rng.uniform(-0.2, 0.2, 2000), rng.uniform(-0.15, 0.15, 2000)
    slope = 8.0 * x
    normals = np.stack([-slope, 0.0 * x, np.ones_like(x)], axis=1) / np.hypot(1.0, slope)[:, None]
    points = np.stack([x, y, 4.0 * x**2], axis=1)
    points += NOISE * rng.normal(size=(2000, 1)) * normals
    fit = fit_scattered(points, ScatteredFitOptions(base="plane"))
    np.testing.assert_allclose(fit.noise, NOISE, rtol=0.04)
    np.testing.assert_allclose(rms(fit.residuals.distances), NOISE, rtol=0.04)


def test_flying_points_are_named_instead_of_a_fold():
    """One in a hundred, 60 mm off; a scan with as many moved by the noise is fitted."""
    points, rng = workpiece(noise=2e-5), np.random.default_rng(5)
    flying = rng.choice(len(points), 20, replace=False)
    points[flying] += 0.06 * rng.choice([-1.0, 1.0], (20, 1)) * R[:, 2]
    with pytest.raises(InputError, match=r"20 of 2000 stand apart .* by up to 0\.0[56]"):
        fit_scattered(points)


@pytest.mark.slow
def test_an_undetermined_point_is_named_in_space():
    """A step of 5 mm: no smooth surface follows, and the scatter about it is said."""
    rng = np.random.default_rng(4)
    points = np.column_stack([rng.uniform(-0.15, 0.15, (3000, 2)), np.zeros(3000)])
    points[:, 2] = 0.005 * (points[:, 0] > 0.01) + 2e-5 * rng.normal(size=3000)
    with pytest.raises(InputError, match=r"surface near \[.*, .*, .*\] m, .* a step or an edge"):
        fit_scattered(points)


@pytest.mark.slow
def test_the_position_of_the_largest_hole():
    points = workpiece(4000)
    flat = flat_place(points)
    centre = np.array([0.05, -0.03])
    left = points[np.linalg.norm(flat[:, :2] - centre, axis=1) > 0.015]
    fit = fit_scattered(left, ScatteredFitOptions(largest_hole=0.03))
    assert 0.013 < fit.hole < 0.02
    np.testing.assert_allclose(flat_place(fit.hole_at)[:2], centre, atol=5e-3)
