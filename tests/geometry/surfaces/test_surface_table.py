"""Expressions of surfaces against the arrays that they are made of."""

import math

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import FourierCurve, Turned, cylinder, extruded_surface, paraboloid, torus
from pfsc_drake.geometry.curves.spline import interpolate
from pfsc_drake.geometry.surfaces.extended import ExtendedSurface, SurfaceTable
from pfsc_drake.geometry.surfaces.product import translated_surface


def _wave(axis, closed=False):
    points = np.zeros((9, 3))
    points[:, axis] = np.linspace(-0.4, 0.4, 9)
    points[:, 2] = 0.02 * np.sin(9.0 * points[:, axis])
    if closed:
        angle = 2.0 * np.pi * np.arange(9) / 9.0
        points = np.stack([np.cos(angle), np.sin(2.0 * angle + 0.3), np.sin(angle)], axis=1)
    return interpolate(points, smoothness=5, closed=closed)


EIGHT = FourierCurve([0, 0, 0], [[0.2, 0, 0], [0, 0, 0]], [[0, 0, 0], [0, 0.1, 0]])
SURFACES = {
    "splines": translated_surface(_wave(0), _wave(1)),
    "closed spline": extruded_surface(_wave(0, closed=True), (0.1, 0.0, 1.0), 0.3),
    "two harmonics": extruded_surface(EIGHT, (0.0, 0.0, 1.0), 0.3),
    "torus": torus(0.5, 0.1),
    "part of a cylinder": cylinder(0.2, (-0.3, 0.3), Turned(angles=(0.0, 2.0))),
    "paraboloid": paraboloid(((-0.3, 0.3), (-0.2, 0.4)), 1.5),
}
LARGER = {name: ExtendedSurface(surface, 4) for name, surface in SURFACES.items()}


@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize("surfaces", [SURFACES, LARGER], ids=["as it is", "extended"])
@pytest.mark.parametrize("name", SURFACES)
def test_partial_derivatives(name, surfaces, order):
    surface = surfaces[name]
    theta = ca.MX.sym("theta", 2)
    function = ca.Function("partials", [theta], [SurfaceTable(surface)(theta, order)])
    rng = np.random.default_rng(6)
    ends, closed = np.array(surface.domain), np.array(surface.closed)
    share = rng.uniform(0.0, 1.0, (60, 2)) + closed * rng.integers(-2, 3, (60, 2))
    places = np.concatenate([ends[:, 0] + share * (ends[:, 1] - ends[:, 0]), ends.T])
    expected = surface.partials(places, order)
    found = np.array([np.array(function(place)).T for place in places])
    size = np.abs(expected).max(axis=(0, 2), keepdims=True) + np.abs(expected).max() * 1e-9
    np.testing.assert_array_less(np.abs(found - expected) / size, 1e-9)


def test_what_is_not_a_number_is_nowhere():
    theta = ca.MX.sym("theta", 2)
    function = ca.Function("partials", [theta], [SurfaceTable(LARGER["splines"])(theta, 1)])
    assert np.isnan(np.array(function([math.nan, 0.1]))).any()


def test_other_kinds_are_refused():
    with pytest.raises(InputError, match="a ProductSurface is required"):
        SurfaceTable(object())
