"""Closed forms against dense samples with another minimizer, and properties of a distance."""

import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    Turned,
    cone,
    cylinder,
    paraboloid,
    plane,
    sphere,
    torus,
    zyx_to_matrix,
)
from pfsc_drake.geometry.shapes.cone import ConeRegion
from pfsc_drake.geometry.shapes.cylinder import CylinderRegion
from pfsc_drake.geometry.shapes.paraboloid import ParaboloidRegion
from pfsc_drake.geometry.shapes.plane import HalfSpace
from pfsc_drake.geometry.shapes.sphere import SphereRegion
from pfsc_drake.geometry.shapes.torus import TorusRegion
from tests.geometry.regions.brute_force import BruteForce, gradient

ORIGIN = np.array([0.3, -0.2, 0.7])
R = zyx_to_matrix([0.4, -0.7, 1.1])
AXIS = 2.5 * R[:, 2]
TURNED = Turned(ORIGIN, R)
WIDE = ((-3.0, 3.0), (-3.0, 3.0))
POLE = math.pi / 2.0 - 1e-5

# of each kind the region outside, the surface it is bounded by, and whether a point in the
# surface's own axes is outside
CASES = {
    "plane": (
        HalfSpace(ORIGIN, AXIS),
        plane(WIDE, ORIGIN, R),
        lambda x, y, z: z > 0.0,
    ),
    "sphere": (
        SphereRegion(ORIGIN, 0.3, inside=False),
        sphere(0.3, (-POLE, POLE), TURNED),
        lambda x, y, z: x * x + y * y + z * z > 0.3**2,
    ),
    "cylinder": (
        CylinderRegion(0.2, ORIGIN, AXIS, inside=False),
        cylinder(0.2, (-3.0, 3.0), TURNED),
        lambda x, y, z: x * x + y * y > 0.2**2,
    ),
    "cone": (
        ConeRegion(0.6, ORIGIN, AXIS, inside=False),
        cone(0.6, (1.5e-6, 1.0), TURNED),
        lambda x, y, z: math.atan2(math.hypot(x, y), z) > 0.6,
    ),
    "torus": (
        TorusRegion(0.3, 0.1, ORIGIN, AXIS, inside=False),
        torus(0.3, 0.1, TURNED),
        lambda x, y, z: (math.hypot(x, y) - 0.3) ** 2 + z * z > 0.1**2,
    ),
    # h_pr = 0.2 m, r_pr = 0.076 m of Sec. 5.2.4
    "paraboloid": (
        ParaboloidRegion(0.2 / 0.076**2, ORIGIN, AXIS, inside=False),
        paraboloid(((-0.4, 0.4), (-0.4, 0.4)), 0.2 / 0.076**2, ORIGIN, R),
        lambda x, y, z: z < (x * x + y * y) * 0.2 / 0.076**2,
    ),
    "flat paraboloid": (
        ParaboloidRegion(-1.5, ORIGIN, AXIS, inside=False),
        paraboloid(WIDE, -1.5, ORIGIN, R),
        lambda x, y, z: z > -1.5 * (x * x + y * y),
    ),
}
INSIDE = {
    "sphere": SphereRegion(ORIGIN, 0.3, inside=True),
    "cylinder": CylinderRegion(0.2, ORIGIN, AXIS, inside=True),
    "cone": ConeRegion(0.6, ORIGIN, AXIS, inside=True),
    "torus": TorusRegion(0.3, 0.1, ORIGIN, AXIS, inside=True),
    "paraboloid": ParaboloidRegion(0.2 / 0.076**2, ORIGIN, AXIS, inside=True),
    "flat paraboloid": ParaboloidRegion(-1.5, ORIGIN, AXIS, inside=True),
}
coordinate = st.floats(-0.8, 0.8)
point = st.tuples(coordinate, coordinate, coordinate)


@pytest.mark.slow(but="plane")
@pytest.mark.parametrize("name", CASES)
def test_distance_is_that_of_brute_force(name):
    region, surface, is_outside = CASES[name]
    brute = BruteForce(surface)
    rng = np.random.default_rng(5)
    sides = []
    for local in rng.uniform(-0.4, 0.4, size=(40, 3)):
        y = ORIGIN + R @ local
        h, *_ = region.distance(*y)
        sides.append(is_outside(*local))
        assert (h > 0.0) == sides[-1]
        assert abs(h) == pytest.approx(brute(y), abs=2e-6, rel=1e-6)
    assert {True, False} == set(sides)


@pytest.mark.parametrize("name", CASES)
def test_gradient_is_a_unit_vector_and_that_of_the_distance(name):
    """The closest point, at the distance h along it, lies on the boundary."""
    distance = CASES[name][0].distance
    rng = np.random.default_rng(6)
    for y in ORIGIN + rng.uniform(-0.4, 0.4, size=(60, 3)):
        h, *n = distance(*y)
        assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-14)
        assert n == pytest.approx(gradient(distance, y), abs=1e-7)
        assert distance(*(y - h * np.array(n)))[0] == pytest.approx(0.0, abs=1e-15)


@pytest.mark.slow(but="plane")
@pytest.mark.parametrize("name", CASES)
def test_it_is_lipschitz(name, examples):
    distance = CASES[name][0].distance

    @examples(200)
    @given(point, point)
    def far_apart(a, b):
        assert abs(distance(*a)[0] - distance(*b)[0]) <= math.dist(a, b) + 1e-14

    @examples(200)
    @given(point, st.tuples(*3 * [st.floats(-1e-3, 1e-3)]))
    def near(a, move):
        b = tuple(x + d for x, d in zip(a, move, strict=True))
        assert abs(distance(*a)[0] - distance(*b)[0]) <= math.dist(a, b) + 1e-14

    far_apart()
    near()


@pytest.mark.parametrize("name", INSIDE)
def test_inside_is_outside_turned_round(name):
    rng = np.random.default_rng(7)
    for y in ORIGIN + rng.uniform(-0.4, 0.4, size=(20, 3)):
        turned = [-value for value in INSIDE[name].distance(*y)]
        assert turned == pytest.approx(CASES[name][0].distance(*y), abs=1e-15)


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("height", [-0.3, 0.0, 0.01, 0.014441, 0.3])
def test_on_the_axis_one_of_the_closest_points_is_reported(name, height):
    """Also at centre, apex and vertex, at the centre of the tube, and where curvature ends."""
    distance = CASES[name][0].distance
    for y in (ORIGIN + height * R[:, 2], ORIGIN + 0.3 * R[:, 0]):
        h, *n = distance(*y)
        assert math.isfinite(h)
        assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-12)
        assert distance(*(y - h * np.array(n)))[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("name", CASES)
def test_symbols_and_numbers_have_one_formula(name):
    """Also of points that are not finite: their distance is no number."""
    region = CASES[name][0]
    for symbol in (ca.SX.sym("point", 3), ca.MX.sym("point", 3)):
        of_symbol = ca.Function("f", [symbol], list(region.signed_distance(symbol)))
        for y in ORIGIN + np.random.default_rng(8).uniform(-0.4, 0.4, size=(5, 3)):
            h, n = of_symbol(y)
            assert (float(h), *n.full().ravel()) == region.distance(*y)
    for y in ((math.nan, 0.1, 0.2), (0.3, 0.1, -math.inf)):
        assert math.isnan(region.distance(*y)[0])


@pytest.mark.slow
@settings(max_examples=100, derandomize=True, deadline=None)
@given(st.floats(-9.0, 9.0), st.floats(-30.0, 3.0), st.floats(-3.0, 3.0))
def test_the_cubic_of_a_paraboloid(curvature, exponent, height):
    """Radius u of the closest point: 2 c^2 u^3 + (1 - 2 c z) u - rho = 0, c and rho of any size."""
    c, rho = 10.0**curvature, 10.0**exponent
    region = ParaboloidRegion(c, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), inside=False)
    h, n_x, n_y, n_z = region.distance(rho, 0.0, height)
    u, z = rho - h * n_x, height - h * n_z
    assert n_y == 0.0
    assert math.isfinite(h)
    # slope of the meridian at the closest point from the normal
    slope = -n_x / n_z
    size = abs(h) + rho + abs(height)
    assert slope / (2.0 * c) == pytest.approx(u, abs=1e-14 * size)
    assert slope**2 / (4.0 * c) == pytest.approx(z, abs=1e-14 * size, rel=1e-9)
    # and no other place of the meridian is nearer
    others = np.concatenate([np.linspace(0.0, 2.0, 101) * u, np.linspace(0.0, 3.0 * rho, 101)])
    nearest = np.hypot(others - rho, c * others**2 - height).min()
    assert abs(h) <= nearest * (1.0 + 1e-12) + 1e-14 * size


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: HalfSpace((0, 0, math.nan), (0, 0, 1)), "region point: .* 3 finite numbers"),
        (lambda: HalfSpace((0, 0, 0), (0, 0, 0)), "axis: .* not all zero"),
        (lambda: HalfSpace((0, 0, 0), (0, 1)), "axis: .* 3 finite numbers"),
        (lambda: SphereRegion((0, 0, 0), 0.0, inside=True), "radius: 0.0 m; a positive number"),
        (
            lambda: CylinderRegion(math.inf, (0, 0, 0), (0, 0, 1), inside=True),
            "radius: inf m; a positive number",
        ),
        (
            lambda: ConeRegion(1.6, (0, 0, 0), (0, 0, 1), inside=True),
            "opening_angle: 1.6 rad; above 0 and below pi/2",
        ),
        (
            lambda: TorusRegion(0.1, 0.2, (0, 0, 0), (0, 0, 1), inside=True),
            "ring_radius: 0.1 m; more than tube_radius = 0.2 m",
        ),
        (
            lambda: ParaboloidRegion(0.0, (0, 0, 0), (0, 0, 1), inside=True),
            "coefficient: 0.0; a finite number that is not zero",
        ),
    ],
)
def test_numbers_that_are_no_shape(make, message):
    with pytest.raises(InputError, match=message):
        make()
