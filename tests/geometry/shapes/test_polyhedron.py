"""Polyhedra against a quadratic program by another method."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize
from scipy.spatial import ConvexHull

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import zyx_to_matrix
from pfsc_drake.geometry.shapes.polyhedron import PolyhedronRegion, box_corners
from tests.geometry.regions.brute_force import gradient

R = zyx_to_matrix([0.4, -0.7, 1.1])
CENTRE = np.array([0.1, -0.2, 0.3])
CORNERS = {
    "box": box_corners((0.4, 0.2, 0.3), CENTRE, R),
    "wedge of 20 degrees": np.array(
        [[x, y, z] for x in (0.0, 0.5) for y, z in ((0.0, 0.0), (0.6, 0.0), (0.6, 0.22))]
    ),
    "random": np.random.default_rng(1).uniform(-0.3, 0.3, size=(14, 3)),
}


def _nearest(corners, y):
    """Distance of a convex combination of the corners, weights found by SLSQP."""
    result = minimize(
        lambda w: np.sum((w @ corners - y) ** 2),
        np.full(len(corners), 1.0 / len(corners)),
        jac=lambda w: 2.0 * corners @ (w @ corners - y),
        bounds=[(0.0, 1.0)] * len(corners),
        constraints={
            "type": "eq",
            "fun": lambda w: w.sum() - 1.0,
            "jac": lambda w: np.ones_like(w),
        },
        method="SLSQP",
        options={"ftol": 1e-15, "maxiter": 300},
    )
    return math.sqrt(result.fun)


@pytest.mark.parametrize("name", CORNERS)
def test_distance_outside_is_that_of_a_quadratic_program(name):
    corners = CORNERS[name]
    region = PolyhedronRegion(corners)
    planes = ConvexHull(corners).equations
    rng, larger = np.random.default_rng(2), 0
    for y in corners.mean(axis=0) + rng.uniform(-0.6, 0.6, size=(40, 3)):
        h, *n = region.distance(*y)
        largest = float((planes[:, :3] @ y + planes[:, 3]).max())
        if largest < 0.0:
            assert h == pytest.approx(largest, abs=1e-14)
            continue
        assert h == pytest.approx(_nearest(corners, y), abs=1e-6)
        assert h >= largest - 1e-14
        larger += h > largest + 1e-3
        assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-13)
        assert n == pytest.approx(gradient(region.distance, y), abs=1e-5)
    assert larger > 5


@pytest.mark.slow(but="wedge of 20 degrees")
@pytest.mark.parametrize("name", CORNERS)
def test_it_is_lipschitz(name, examples):
    region = PolyhedronRegion(CORNERS[name])
    coordinate = st.floats(-0.6, 0.6)
    place = st.tuples(coordinate, coordinate, coordinate)

    @examples(200)
    @given(place, place)
    def lipschitz(a, b):
        first, second = region.distance(*a)[0], region.distance(*b)[0]
        assert abs(first - second) <= math.dist(a, b) + 1e-12

    lipschitz()


def test_a_box():
    region = PolyhedronRegion(box_corners((0.4, 0.2, 0.3), CENTRE, R))
    for local, h, n in [
        ((0.3, 0.05, 0.1), 0.1, (1, 0, 0)),
        ((0.0, 0.0, -0.3), 0.15, (0, 0, -1)),
        ((0.23, 0.14, 0.0), 0.05, (0.6, 0.8, 0)),
        ((0.19, 0.0, 0.0), -0.01, (1, 0, 0)),
    ]:
        value, *normal = region.distance(*(CENTRE + R @ local))
        assert value == pytest.approx(h, abs=1e-14)
        assert R.T @ normal == pytest.approx(n, abs=1e-12)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: PolyhedronRegion([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]), "span no volume"),
        (lambda: PolyhedronRegion([[0, 0, math.nan]] * 4), "finite numbers"),
        (lambda: box_corners((0.1, 0.0, 0.1), CENTRE, None), "box size: .* 3 positive numbers"),
    ],
)
def test_corners_that_are_none(make, message):
    with pytest.raises(InputError, match=message):
        make()
