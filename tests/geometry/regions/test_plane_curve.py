"""Regions of profiles against closed forms, polygons and brute force."""

import math

import numpy as np
import pytest

from pfsc_drake.compiled.bound_function import PlainFunction
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    PiecewisePolynomialCurve,
    extruded_surface,
    interpolate,
    rotation_from_axes,
    surface_of_revolution,
    zyx_to_matrix,
)
from pfsc_drake.geometry.regions.plane_curve import PlaneCurve
from pfsc_drake.geometry.shapes.cone import ConeRegion
from pfsc_drake.geometry.shapes.cylinder import CylinderRegion
from pfsc_drake.geometry.shapes.plane import HalfSpace
from pfsc_drake.geometry.shapes.profiles import ExtrudedRegion, RevolvedRegion
from tests.geometry.regions.brute_force import BruteForce, gradient

ORIGIN = np.array([0.3, -0.2, 0.7])
R = zyx_to_matrix([0.4, -0.7, 1.1])
AXIS = R[:, 2]
ANGLE = 0.6


def _blob(count=12, *, clockwise=False, lift=0.0):
    """A closed profile with bays, in the plane or climbing."""
    t = np.linspace(0.0, 2.0 * math.pi, count, endpoint=False)
    t = -t if clockwise else t
    radius = 0.2 + 0.08 * np.cos(3.0 * t)
    points = np.stack([0.5 + radius * np.cos(t), radius * np.sin(t)], axis=1)
    return points if not lift else np.column_stack([points, lift * np.sin(t)])


def _wave():
    x = np.linspace(-0.3, 0.3, 15)
    return interpolate(np.stack([x, 0.08 * np.sin(15.0 * x)], axis=1), smoothness=3)


def _encloses(corners, x, y):
    """Even-odd rule."""
    (x_1, y_1), (x_2, y_2) = corners.T, np.roll(corners, -1, axis=0).T
    crosses = (y_1 > y) != (y_2 > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = x_1 + (y - y_1) * (x_2 - x_1) / (y_2 - y_1)
    return bool(np.sum(crosses & (at > x)) % 2)


@pytest.mark.slow
@pytest.mark.parametrize("clockwise", [False, True])
@pytest.mark.parametrize("inside", [False, True])
def test_an_extruded_closed_profile(clockwise, inside):
    """Climbing along the direction, too: the tube is that of its shadow."""
    points = _blob(clockwise=clockwise, lift=0.1)
    profile = interpolate(points @ R.T + ORIGIN, smoothness=3, closed=True)
    region = ExtrudedRegion(profile, 2.0 * AXIS, inside=inside)
    long = PiecewisePolynomialCurve(
        profile.breakpoints,
        profile.coefficients - 1.5 * np.eye(1, profile.coefficients.shape[1])[0][:, None] * AXIS,
        closed=True,
    )
    brute = BruteForce(extruded_surface(long, AXIS, 3.0))
    flat = interpolate(points, smoothness=3, closed=True)
    corners = flat.derivatives(np.linspace(*flat.domain, 2000)[:-1], 0)[:, 0, :2]
    rng, sides = np.random.default_rng(2), []
    for local in rng.uniform((0.1, -0.4, -0.3), (0.9, 0.4, 0.3), size=(25, 3)):
        y = ORIGIN + R @ local
        h, *n = region.distance(*y)
        sides.append(_encloses(corners, *local[:2]))
        assert (h > 0.0) == (sides[-1] == inside)
        assert abs(h) == pytest.approx(brute(y), abs=1e-7)
        assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-12)
        assert n == pytest.approx(gradient(region.distance, y), abs=1e-5)
    assert {True, False} == set(sides)


@pytest.mark.slow(but="True")
@pytest.mark.parametrize("inside", [False, True])
def test_a_revolved_closed_profile(inside):
    profile = interpolate(_blob(), smoothness=3, closed=True)
    region = RevolvedRegion(profile, ORIGIN, AXIS, inside=inside)
    brute = BruteForce(
        surface_of_revolution(profile, origin=ORIGIN, rotation=rotation_from_axes(AXIS, R[:, 0]))
    )
    corners = profile.derivatives(np.linspace(*profile.domain, 2000)[:-1], 0)[:, 0]
    for local in np.random.default_rng(3).uniform(-0.7, 0.7, size=(25, 3)) * [1, 1, 0.5]:
        y = ORIGIN + R @ local
        h, *n = region.distance(*y)
        assert (h > 0.0) == (_encloses(corners, math.hypot(*local[:2]), local[2]) == inside)
        assert abs(h) == pytest.approx(brute(y), abs=1e-7)
        assert n == pytest.approx(gradient(region.distance, y), abs=1e-5)


def test_straight_profiles_are_planes_cones_and_cylinders():
    """Whose ends go on as far as the axis, or without end."""
    across = PiecewisePolynomialCurve.line(ORIGIN, ORIGIN + 0.1 * R[:, 0] + 0.05 * AXIS)
    half_space = HalfSpace(ORIGIN, np.cross(R[:, 0], AXIS))
    slope = np.array([math.sin(ANGLE), math.cos(ANGLE)])
    pairs = [
        (ExtrudedRegion(across, AXIS, inside=False), half_space),
        (
            RevolvedRegion(
                PiecewisePolynomialCurve.line(0.1 * slope, 0.2 * slope), ORIGIN, AXIS, inside=False
            ),
            ConeRegion(ANGLE, ORIGIN, AXIS, inside=False),
        ),
        (
            RevolvedRegion(
                PiecewisePolynomialCurve.line((0.2, 0.0), (0.2, 0.1)), ORIGIN, AXIS, inside=True
            ),
            CylinderRegion(0.2, ORIGIN, AXIS, inside=True),
        ),
    ]
    for region, expected in pairs:
        for y in ORIGIN + np.random.default_rng(4).uniform(-0.5, 0.5, size=(60, 3)):
            assert region.distance(*y) == pytest.approx(expected.distance(*y), abs=1e-12)


def test_the_ends_of_an_open_profile_go_on_straight():
    curve = _wave()
    distance = PlainFunction(PlaneCurve(curve).signed_distance)
    theta = np.linspace(*curve.domain, 20001)
    line = curve.derivatives(theta, 1)
    way = np.linspace(0.0, 2.0, 20001)[:, None]
    tails = [
        line[k, 0] + s * way * line[k, 1] / np.linalg.norm(line[k, 1])
        for k, s in ((0, -1), (-1, 1))
    ]
    every = np.concatenate([line[:, 0], *tails])
    # a polygon below all of it
    around = np.concatenate([tails[0][::-1], line[:, 0], tails[1], [[3.0, -9.0], [-3.0, -9.0]]])
    for x, y in np.random.default_rng(5).uniform((-0.8, -0.3), (0.8, 0.3), size=(60, 2)):
        h, *n = distance(x, y)
        nearest = np.hypot(*(every - (x, y)).T).min()
        assert abs(h) == pytest.approx(nearest, abs=2e-6, rel=1e-4)
        assert (h > 0.0) == _encloses(around, x, y)  # right of a way along x
        closest_point = np.array([x, y]) - h * np.array(n)
        assert distance(*closest_point)[0] == pytest.approx(0.0, abs=1e-10)


def test_where_all_points_are_equally_near_one_of_them_is_reported():
    """Around the centre of a circle, whose radius a spline has to a few um."""
    t = np.linspace(0.0, 2.0 * math.pi, 12, endpoint=False)
    curve = interpolate(0.2 * np.stack([np.cos(t), np.sin(t)], axis=1), smoothness=3, closed=True)
    distance = PlainFunction(PlaneCurve(curve).signed_distance)
    every = curve.derivatives(np.linspace(*curve.domain, 200001), 0)[:, 0]
    for x, y in np.random.default_rng(6).uniform(-1e-4, 1e-4, size=(20, 2)):
        h, *n = distance(x, y)
        assert h == pytest.approx(-np.hypot(*(every - (x, y)).T).min(), abs=1e-10)
        assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-12)
    assert all(math.isnan(value) for value in distance(math.nan, 0.0))


def test_a_bell_is_closed_at_its_tip():
    """Over the small hole that a profile must leave the ends go on to the axis."""
    rho = np.linspace(0.01, 0.2, 12)
    bell = interpolate(np.stack([rho, -4.0 * rho**2], axis=1), smoothness=3)
    region = RevolvedRegion(bell, (0, 0, 0), (0, 0, 1), inside=True)
    (rho_0, h_0), (rho_1, h_1) = bell.derivatives(bell.domain[0], 1)
    tip = h_0 - rho_0 * h_1 / rho_1
    for height in (0.1, tip + 1e-6):
        h, *n = region.distance(0.0, 0.0, height)
        assert h == pytest.approx(height - tip, rel=0.02)
        assert n == pytest.approx((0.0, 0.0, 1.0), abs=0.2)
    for height in (tip - 1e-6, -0.05, -1.0):
        assert region.distance(0.0, 0.0, height)[0] < 0.0


def test_profiles_that_divide_nothing():
    spiral = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.1, 0.4], [0.4, 0.3]])
    with pytest.raises(InputError, match="its last end, extended straight, meets it"):
        PlaneCurve(interpolate(spiral, smoothness=3))
    horseshoe = np.array([[-0.2, 0.0], [-0.5, 0.5], [0.0, 1.0], [0.5, 0.5], [0.2, 0.0]])
    with pytest.raises(InputError, match="its ends, extended straight, meet each other"):
        PlaneCurve(interpolate(horseshoe, smoothness=3))
    kinked = PiecewisePolynomialCurve([0.0, 1.0, 2.0], [[[0, 0], [1, 0]], [[1, 0], [1, 1]]])
    with pytest.raises(InputError, match=r"class C\^0; C\^2 or smoother"):
        PlaneCurve(kinked)
