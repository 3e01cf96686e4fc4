"""Shapes against closed forms as Taylor series along lines of the parameters."""

import math

import numpy as np
import pytest

from pfsc_drake import jets
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    FourierCurve,
    PiecewisePolynomialCurve,
    Turned,
    cone,
    cylinder,
    extruded_surface,
    interpolate,
    paraboloid,
    partial_orders,
    plane,
    rotation_from_axes,
    sphere,
    surface_of_revolution,
    torus,
    translated_surface,
    zyx_to_matrix,
)
from pfsc_drake.jets import Jet

ORIGIN = np.array([0.3, -0.2, 0.7])
R = zyx_to_matrix([0.4, -0.7, 1.1])
TURNED = Turned(ORIGIN, R)
SIZE = ((-0.3, 0.4), (-0.2, 0.5))


def _turned(u, rho, height):
    s, c = jets.sin_cos(u)
    return jets.vector([rho * c, rho * s, height])


def _sphere(u, v):
    s, c = jets.sin_cos(v)
    return _turned(u, 0.2 * c, 0.2 * s)


def _torus(u, v):
    s, c = jets.sin_cos(v)
    return _turned(u, 0.5 + 0.1 * c, 0.1 * s)


CASES = {
    "plane": (plane(SIZE, ORIGIN, R), lambda u, v: jets.vector([u, v, 0.0 * u])),
    "paraboloid": (
        paraboloid(SIZE, 1.667, ORIGIN, R),
        lambda u, v: jets.vector([u, v, 1.667 * (u**2 + v**2)]),
    ),
    "cylinder": (
        cylinder(0.09, (-0.2, 0.5), TURNED),
        lambda u, v: _turned(u, jets.constant(0.09, u.order), v),
    ),
    "cone": (
        cone(0.5, (0.01, 0.5), TURNED),
        lambda u, v: _turned(u, math.sin(0.5) * v, math.cos(0.5) * v),
    ),
    "sphere": (sphere(0.2, (-1.4, 1.4), TURNED), _sphere),
    "torus": (torus(0.5, 0.1, TURNED), _torus),
}


@pytest.mark.parametrize("name", CASES)
def test_partial_derivatives_along_lines(name):
    surface, closed_form = CASES[name]
    rng = np.random.default_rng(1)
    (begin_1, end_1), (begin_2, end_2) = surface.domain
    for _ in range(10):
        theta = np.array([rng.uniform(begin_1, end_1), rng.uniform(begin_2, end_2)])
        d = rng.normal(size=2)
        u, v = (Jet([theta[k], d[k], *[0.0] * 5]) for k in (0, 1))
        expected = [R @ c for c in closed_form(u, v).coefficients]
        expected[0] = expected[0] + ORIGIN
        found = np.zeros((7, 3))
        for (i, j), row in zip(partial_orders(6), surface.partials(theta, 6), strict=True):
            weight = d[0] ** i * d[1] ** j / (math.factorial(i) * math.factorial(j))
            found[i + j] += weight * row
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("order", [0, 2, 6])
def test_sampler_and_arrays_agree(name, order):
    surface, _ = CASES[name]
    rng = np.random.default_rng(2)
    ends = np.array(surface.domain)
    theta = rng.uniform(ends[:, 0], ends[:, 1], size=(3, 5, 2))
    values = surface.partials(theta, order)
    sample = surface.flat_sampler(order)
    for index in np.ndindex(3, 5):
        found = sample(*theta[index].tolist())
        np.testing.assert_allclose(found, values[index].ravel(), atol=1e-14)


def test_surface_of_piecewise_curves_is_their_sum_and_differentiated():
    rng = np.random.default_rng(5)
    profile = interpolate(
        rng.normal(size=(7, 3)) + 4.0 * np.arange(7)[:, None] * [1, 0, 0], smoothness=3
    )
    rail = interpolate(
        rng.normal(size=(6, 3)) + 4.0 * np.arange(6)[:, None] * [0, 1, 0], smoothness=3
    )
    surface = translated_surface(profile, rail)
    ends = np.array(surface.domain)
    theta = rng.uniform(ends[:, 0], ends[:, 1], size=(40, 2))
    first, second = profile.derivatives(theta[:, 0], 3), rail.derivatives(theta[:, 1], 3)
    for k, (i, j) in enumerate(partial_orders(3)):
        expected = (first[:, i] if j == 0 else 0.0) + (second[:, j] if i == 0 else 0.0)
        found = surface.partials(theta, 3)[:, k]
        np.testing.assert_allclose(found, np.broadcast_to(expected, (40, 3)), atol=1e-12)
    sample = surface.flat_sampler(3)
    expected = surface.partials(theta[0], 3).ravel()
    np.testing.assert_allclose(sample(*theta[0].tolist()), expected, atol=1e-12)
    assert surface.smoothness == min(profile.smoothness, rail.smoothness)


def test_closed_extrusion_wraps():
    points = [[math.cos(a), 0.6 * math.sin(a), 0.0] for a in np.linspace(0, 5.6, 9)]
    profile = interpolate(np.array(points), smoothness=3, closed=True)
    surface = extruded_surface(profile, (0.0, 0.0, 2.0), 0.4)
    assert surface.closed == (True, False)
    assert surface.domain[1] == (0.0, 0.4)
    theta = np.array([0.3, 0.1])
    revolution = np.add(theta, (3 * profile.period, 0.0))
    np.testing.assert_allclose(
        surface.partials(revolution, 2), surface.partials(theta, 2), atol=1e-12
    )
    sample = surface.flat_sampler(2)
    np.testing.assert_allclose(sample(*revolution), sample(*theta), atol=1e-12)


def test_cylinder_of_the_experiment():
    """(4.50): r = 90 mm, c = 505 mm, whose normal points to the axis."""
    rotation = rotation_from_axes((0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
    turned = Turned((0.0, 0.0, 0.505), rotation, inward=True)
    surface = cylinder(0.09, (-0.1, 0.1), turned)
    theta = np.array([0.7, 0.03])
    position, first, second = surface.partials(theta, 1)
    expected = [0.09 * math.cos(0.7), 0.03, 0.09 * math.sin(0.7) + 0.505]
    np.testing.assert_allclose(position, expected, atol=1e-15)
    normal = np.cross(first, second) / 0.09
    np.testing.assert_allclose(normal, [-math.cos(0.7), 0.0, -math.sin(0.7)], atol=1e-15)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: cylinder(-0.1, (0.0, 1.0)), "cylinder radius: -0.1 m"),
        (lambda: cylinder(0.1, (1.0, 0.0)), "theta_2: from 1.0 to 0.0"),
        (lambda: cylinder(0.1, (0.0, math.nan)), "theta_2: from 0.0 to nan"),
        (lambda: cylinder(0.1, (0.0, 1.0), Turned(angles=(0.0, 7.0))), "angles: .*at most 6.28"),
        (lambda: cylinder(0.1, (0.0, 1.0), Turned(rotation=np.eye(3) * 2)), "surface rotation"),
        (lambda: cylinder(0.1, (0.0, 1.0), Turned(origin=(0, math.nan, 0))), "surface origin"),
        (lambda: sphere(0.1, (-1.0, math.pi / 2)), "without the poles"),
        (lambda: cone(0.5, (0.0, 1.0)), "no normal at its apex"),
        (lambda: cone(1.6, (0.1, 1.0)), "opening_angle: 1.6 rad"),
        (lambda: torus(0.1, 0.2), "ring_radius: 0.1 m; more than"),
        (lambda: paraboloid((1, 1), math.inf), "paraboloid coefficient: inf"),
        (lambda: plane((1, 0)), "theta_2: from 0.0 to 0"),
        (lambda: rotation_from_axes((0, 0, 1), (0, 0, -2)), "not along axis"),
        (lambda: rotation_from_axes((0, 0, 0), (0, 0, -2)), "axis: .*not all zero"),
        (
            lambda: surface_of_revolution(FourierCurve.circle((0, 0), 0.1, (1, 0), (0, 1))),
            "not regular at theta = .*leave out poles",
        ),
        (
            lambda: surface_of_revolution(FourierCurve.circle((0.05, 0), 0.1, (1, 0), (0, 1))),
            "normal flips at theta",
        ),
        (lambda: surface_of_revolution(FourierCurve.bent_lemniscate()), "profile: dimension 3"),
        (
            lambda: extruded_surface(
                PiecewisePolynomialCurve.line([0, 0, 0], [1, 0, 0]), (1, 0, 0), 1
            ),
            "not regular at theta",
        ),
        (
            lambda: extruded_surface(
                PiecewisePolynomialCurve.line([0, 0, 0], [1, 0, 0]), (0, 0, 1), 0
            ),
            "extrusion: .* length 0",
        ),
    ],
)
def test_what_is_no_surface(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_parameters_outside_of_an_open_direction():
    surface = CASES["cylinder"][0]
    surface.partials([100.0, 0.5], 0)
    with pytest.raises(InputError, match=r"theta_2: 0.6; .* \[-0.2, 0.5\]"):
        surface.partials([[0.0, 0.0], [0.0, 0.6]], 0)
    with pytest.raises(InputError, match="from 0 to 6"):
        surface.partials([0.0, 0.0], 7)
    with pytest.raises(InputError, match="theta: shape"):
        surface.partials([0.0, 0.0, 0.0], 1)
