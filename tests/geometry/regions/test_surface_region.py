"""Regions of any surface against closed forms, dense samples and another minimizer."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pfsc_drake.compiled.bound_function import PlainFunction
from pfsc_drake.geometry import (
    FourierCurve,
    SurfaceProjector,
    Turned,
    extruded_surface,
    plane,
    surface_through_grid,
    torus,
    zyx_to_matrix,
)
from pfsc_drake.geometry.regions.surface_region import SurfaceRegion
from pfsc_drake.geometry.shapes.torus import TorusRegion
from tests.geometry.regions.brute_force import BruteForce, gradient

ORIGIN = np.array([0.3, -0.2, 0.7])
R = zyx_to_matrix([0.4, -0.7, 1.1])


def _grid(height, lean=0.0):
    x, y = np.meshgrid(np.linspace(-0.4, 0.4, 30), np.linspace(-0.3, 0.3, 20), indexing="ij")
    points = np.stack([x + lean * np.sin(20.0 * x), y, height(x, y)], axis=-1)
    return surface_through_grid(points, smoothness=3)


@pytest.fixture(scope="module")
def hills():
    return _grid(lambda x, y: 0.03 * np.sin(9.0 * x) * np.cos(7.0 * y))


@pytest.fixture(scope="module")
def folds():
    """Valleys 8 cm deep that overhang."""
    return _grid(lambda x, y: 0.04 * np.sin(25.0 * x) * np.cos(4.0 * y), lean=0.03)


@pytest.fixture(scope="module")
def tube():
    """A bent tube of oval section, closed in one direction."""
    oval = FourierCurve([0.0] * 3, [[0.2, 0, 0], [0, 0.02, 0]], [[0, 0.1, 0], [0, 0, 0]])
    return extruded_surface(oval, (0.2, 0.1, 1.0), 0.5)


@pytest.fixture(scope="module", params=["hills", "folds", "tube"])
def case(request):
    surface = request.getfixturevalue(request.param)
    return surface, SurfaceRegion(surface, above=True)


def _near(surface, count, reach, seed):
    """Points beside a surface, and their distances along its normals, shorter than they bend."""
    rng = np.random.default_rng(seed)
    theta = np.stack([rng.uniform(*ends, count) for ends in surface.domain], axis=1)
    position, first, second = np.moveaxis(surface.partials(theta, 1), -2, 0)
    normal = np.cross(first, second)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    height = rng.uniform(-reach, reach, count)
    return position + height[:, None] * normal, height, normal


def test_it_is_the_closed_form_of_a_torus():
    turned = Turned(ORIGIN, R)
    region = SurfaceRegion(torus(0.3, 0.1, turned), above=True)
    other = SurfaceRegion(torus(0.3, 0.1, turned), above=False)
    expected = TorusRegion(0.3, 0.1, ORIGIN, R[:, 2], inside=False)
    for y in ORIGIN + np.random.default_rng(2).uniform(-0.5, 0.5, size=(60, 3)):
        assert region.distance(*y) == pytest.approx(expected.distance(*y), abs=1e-13)
        assert other.distance(*y) == pytest.approx([-v for v in expected.distance(*y)], abs=1e-13)


@pytest.mark.slow(but="hills")
def test_distance_is_that_of_brute_force(case):
    """Near and far, and beside the border."""
    surface, region = case
    brute = BruteForce(surface, 200)
    rng = np.random.default_rng(1)
    for y in rng.uniform(-0.45, 0.45, size=(40, 3)):
        h = abs(region.distance(*y)[0])
        expected = brute(y)
        assert h <= expected + 1e-12
        assert h == pytest.approx(expected, abs=1e-7)


def test_close_to_it_sign_and_normal_are_those_of_the_surface(case):
    surface, region = case
    points, heights, normals = _near(surface, 60, 2e-3, seed=3)
    for y, height, normal in zip(points, heights, normals, strict=True):
        h, *n = region.distance(*y)
        assert h == pytest.approx(height, abs=1e-12)
        assert n == pytest.approx(normal, abs=1e-9)


def test_gradient_is_that_of_the_distance(case):
    surface, region = case
    for y, _, _ in zip(*_near(surface, 30, 0.1, seed=4), strict=True):
        h, *n = region.distance(*y)
        assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-12)
        turns = [region.distance(*(y + d))[1:] for d in 2e-6 * np.vstack([np.eye(3), -np.eye(3)])]
        if np.abs(np.array(turns) - n).max() < 1e-2:  # no other place is as near
            assert n == pytest.approx(gradient(region.distance, y), abs=1e-5)
        # the closest point
        assert abs(region.distance(*(y - h * np.array(n)))[0]) < 1e-12


def test_the_formula_of_few_pieces_finds_what_the_tree_finds():
    """Above and below a bump, and beside its border."""
    x, y = np.meshgrid(np.linspace(-0.4, 0.4, 12), np.linspace(-0.3, 0.3, 9), indexing="ij")
    points = np.stack([x, y, 0.04 * np.cos(4.0 * x) * np.cos(3.0 * y)], axis=-1)
    region = SurfaceRegion(surface_through_grid(points, smoothness=3), above=False)
    formula = PlainFunction(region.signed_distance)
    for place in np.random.default_rng(7).uniform(-0.6, 0.6, size=(200, 3)).tolist():
        assert formula(*place) == pytest.approx(region.distance(*place), abs=1e-12)
    assert math.isnan(formula(math.nan, 0.0, 0.0)[0])


def test_it_is_lipschitz(case, examples):
    """Of h on an admissible way, of |h| everywhere."""
    _, region = case
    coordinate = st.floats(-0.5, 0.5)
    place = st.tuples(coordinate, coordinate, coordinate)

    @examples(60)
    @given(place, st.tuples(*3 * [st.floats(-0.05, 0.05)]))
    def lipschitz(a, move):
        b = tuple(x + d for x, d in zip(a, move, strict=True))
        first, second = region.distance(*a)[0], region.distance(*b)[0]
        assert abs(abs(first) - abs(second)) <= math.dist(a, b) + 1e-12

    lipschitz()


@pytest.mark.slow
def test_newton_from_the_last_projection_is_no_bound(folds):
    """Along a straight way over the valleys it stays behind; the region's distance is global."""
    region, project = SurfaceRegion(folds, above=True), SurfaceProjector(folds).project
    brute = BruteForce(folds, 200)
    begin = (-0.3, 0.0)
    theta, behind = begin, 0.0
    for x in np.linspace(-0.3, 0.3, 61):
        y = (float(x), 0.05, 0.06)
        closest_point = project(y, theta)
        theta = closest_point.theta
        h = region.distance(*y)[0]
        assert abs(h) == pytest.approx(brute(y), abs=1e-7)
        behind = max(behind, closest_point.distance - abs(h))
    assert behind > 0.01


def test_beyond_the_border_the_sheet_has_ended():
    """The distance is that of the border, admissible, away from it; under the sheet it is not."""
    region = SurfaceRegion(plane(((-0.2, 0.2), (-0.1, 0.1)), ORIGIN, R), above=True)
    for local, closest_point, sign in [
        ((0.3, 0.0, 0.05), (0.2, 0.0, 0.0), 1.0),
        ((0.3, 0.2, -0.05), (0.2, 0.1, 0.0), 1.0),
        ((0.1, -0.3, 0.0), (0.1, -0.1, 0.0), 1.0),
        ((0.1, 0.05, -0.04), (0.1, 0.05, 0.0), -1.0),
        ((0.1, 0.05, 0.04), (0.1, 0.05, 0.0), 1.0),
    ]:
        h, *n = region.distance(*(ORIGIN + R @ local))
        way = np.subtract(local, closest_point)
        assert h == pytest.approx(sign * np.linalg.norm(way), abs=1e-13)
        assert R.T @ n == pytest.approx(sign * way / np.linalg.norm(way), abs=1e-12)


def test_on_the_surface_and_its_border():
    region = SurfaceRegion(plane(((-0.2, 0.2), (-0.1, 0.1)), ORIGIN, R), above=False)
    for local in [(0.0, 0.0, 0.0), (0.2, 0.05, 0.0), (0.2, 0.1, 0.0), (0.123, -0.1, 0.0)]:
        h, *n = region.distance(*(ORIGIN + R @ local))
        assert h == pytest.approx(0.0, abs=1e-15)
        assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-12)
