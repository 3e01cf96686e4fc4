"""Surfaces beyond the ends of their open directions."""

import math

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from pfsc_drake.geometry.curves.spline import interpolate
from pfsc_drake.geometry.nearest_samples import ProjectionStatus
from pfsc_drake.geometry.shapes.cone import cone
from pfsc_drake.geometry.shapes.cylinder import cylinder
from pfsc_drake.geometry.shapes.paraboloid import paraboloid
from pfsc_drake.geometry.shapes.plane import plane
from pfsc_drake.geometry.shapes.revolution import Turned
from pfsc_drake.geometry.shapes.sphere import sphere
from pfsc_drake.geometry.surfaces.extended import ExtendedSurface
from pfsc_drake.geometry.surfaces.parametric_surface import partial_orders
from pfsc_drake.geometry.surfaces.product import extruded_surface, translated_surface
from pfsc_drake.geometry.surfaces.surface_evaluator import SurfaceEvaluator

ORDER = 5


def _wave(axis):
    points = np.zeros((9, 3))
    points[:, axis] = np.linspace(-0.4, 0.4, 9)
    points[:, 2] = 0.02 * np.sin(9.0 * points[:, axis])
    return interpolate(points, smoothness=5)


SURFACES = {
    "paraboloid": paraboloid(((-0.3, 0.3), (-0.4, 0.4)), 0.8),
    "part of a cylinder": cylinder(0.2, (-0.3, 0.3), Turned(angles=(0.0, 2.0))),
    "extruded": extruded_surface(_wave(0), (0.0, 0.6, 0.8), 0.3),
    "splines": translated_surface(_wave(0), _wave(1)),
}


@pytest.fixture(params=SURFACES)
def pair(request):
    surface = SURFACES[request.param]
    return surface, ExtendedSurface(surface, ORDER)


def _rows(surface, theta, order=ORDER):
    return surface.flat_sampler(order)(*theta).reshape(-1, 3)


def test_within_the_domain_it_is_the_surface(pair):
    surface, extended = pair
    for share in ((0.0, 0.0), (0.3, 0.9), (1.0, 0.5), (1.0, 1.0)):
        theta = [b + s * (e - b) for s, (b, e) in zip(share, surface.domain, strict=True)]
        np.testing.assert_array_equal(_rows(extended, theta), _rows(surface, theta))
        np.testing.assert_array_equal(extended.partials(theta, ORDER), _rows(surface, theta))


@pytest.mark.slow(
    but=[
        "paraboloid-0-0",
        "paraboloid-1-1",
        "part of a cylinder-0-1",
        "part of a cylinder-1-0",
        "extruded-0-0",
        "extruded-1-0",
        "splines-0-1",
    ]
)
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("side", [0, 1])
def test_it_goes_on_in_its_class(pair, axis, side):
    """All partial derivatives agree on both sides of the border."""
    surface, extended = pair
    begin, end = surface.domain[axis]
    border = surface.domain[axis][side]
    middle = 0.3 * surface.domain[1 - axis][0] + 0.7 * surface.domain[1 - axis][1]
    out = border + (2 * side - 1) * 1e-9 * (end - begin)
    at, beyond = (_rows(extended, (t, middle) if axis == 0 else (middle, t)) for t in (border, out))
    scale = 1.0 + np.abs(at).max(axis=1, keepdims=True)
    np.testing.assert_allclose(beyond / scale, at / scale, atol=1e-4)


@pytest.mark.slow(but="part of a cylinder-0")
@pytest.mark.parametrize("axis", [0, 1])
def test_derivatives_along_the_path(pair, axis):
    """Every row along lines out over both borders is the integral of the next order's row."""
    surface, extended = pair
    orders, sample = partial_orders(ORDER), extended.flat_sampler(ORDER)
    for share in (-0.15, 0.4, 1.12):
        begin, end = surface.domain[1 - axis]
        other = begin + share * (end - begin)
        first, last = extended.domain[axis]
        borders, beside = surface.domain[axis], np.array([-1e-9, 1e-9])
        pieces = np.split(np.sort([first, last, *np.add.outer(borders, beside).ravel()]), 3)
        t = np.concatenate([np.linspace(*piece, 401) for piece in pieces])
        theta = np.stack([t, np.full_like(t, other)][:: 1 - 2 * axis], axis=-1)
        rows = np.array([sample(*place) for place in theta]).reshape(len(t), -1, 3)
        for k, (i, j) in enumerate(orders):
            higher = (i + 1, j) if axis == 0 else (i, j + 1)
            if higher not in orders:
                continue
            higher_rows = rows[:, orders.index(higher)]
            integral = cumulative_trapezoid(higher_rows, t, axis=0, initial=0.0)
            scale = np.abs(higher_rows).max() * (last - first) + np.abs(rows[:, k]).max()
            np.testing.assert_allclose(rows[:, k] - rows[0, k], integral, atol=3e-5 * scale)


@pytest.mark.parametrize("name", ["paraboloid", "extruded", "splines"])
def test_it_gets_straight(name):
    extended = ExtendedSurface(SURFACES[name], ORDER)
    for axis in (0, 1):
        middle = 0.4 * sum(extended.domain[1 - axis])
        for limit in extended.domain[axis]:
            theta = (limit, middle) if axis == 0 else (middle, limit)
            own = [(i, j)[axis] > 1 for i, j in partial_orders(ORDER)]
            assert not _rows(extended, theta)[own].any()


def test_what_is_straight_or_round_stays_so():
    extended = ExtendedSurface(SURFACES["part of a cylinder"], ORDER)
    (first, last), (low, high) = extended.domain
    assert (low, high) == pytest.approx((-0.45, 0.45))
    assert (first, last) == pytest.approx((-0.5, 2.5))
    for theta in ((-0.4, 0.0), (2.4, 0.42), (1.0, -0.44)):
        x, y, z = _rows(extended, theta)[0]
        expected = [0.2 * math.cos(theta[0]), 0.2 * math.sin(theta[0]), theta[1]]
        assert [x, y, z] == pytest.approx(expected, abs=1e-15)


def test_it_ends_before_poles_apices_and_its_own_begin():
    north, south = ExtendedSurface(sphere(0.2, (-1.3, 1.3)), ORDER).domain[1]
    assert -math.pi / 2 < north < -1.3
    assert 1.3 < south < math.pi / 2
    assert 0.03 <= ExtendedSurface(cone(0.5, (0.1, 0.6)), ORDER).domain[1].begin < 0.1
    nearly_closed = cylinder(0.2, (0.0, 0.1), Turned(angles=(0.0, 6.0)))
    assert ExtendedSurface(nearly_closed, ORDER).domain[0].length < 2.0 * math.pi


def test_beyond_the_extension_the_border_has_the_closest_point():
    evaluator, ends_at = SurfaceEvaluator(plane((1.0, 1.0)), 2), 1.25
    theta, eta = (0.98, 0.5), (0.0, 0.0)
    for x in np.linspace(0.98, 1.4, 43):
        row = evaluator((float(x), 0.5, 0.1), theta, eta)
        theta, eta = tuple(row[:2].tolist()), tuple(row[2:4].tolist())
        assert theta == pytest.approx((min(x, ends_at), 0.5), abs=1e-12)
        assert eta == pytest.approx((min(x, ends_at) - 0.98, 0.0), abs=1e-12)
        assert row[5] == (ProjectionStatus.BEYOND_END if x > 1.0 else ProjectionStatus.OK)
