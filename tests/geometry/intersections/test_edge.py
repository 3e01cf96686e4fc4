"""Edges of two surfaces against closed forms, and against the equations of both."""

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    FourierCurve,
    PiecewisePolynomialCurve,
    Turned,
    cone,
    cylinder,
    extruded_surface,
    find_edge,
    find_edges,
    interpolate,
    paraboloid,
    plane,
    rotation_from_axes,
    sphere,
    torus,
)
from pfsc_drake.geometry.intersections import edge as edge_module

SQUARE = ((-0.5, 0.5), (-0.5, 0.5))
WIDE = (-1.2, 1.2)


def tilted(axis):
    return rotation_from_axes(axis, (1.0, 0.1, 0.0) if abs(axis[0]) < 0.9 else (0.0, 1.0, 0.0))


def floor(height=0.0):
    return plane(SQUARE, (0.0, 0.0, height))


def places(curve, count=400):
    """Return points and derivatives along a curve, [count, 3] each."""
    return np.moveaxis(curve.derivatives(np.linspace(*curve.domain, count), 1), 1, 0)


CIRCLES = {
    "plane, sphere": (floor(0.05), sphere(0.2, WIDE), (0, 0, 0.05), np.sqrt(0.04 - 0.0025)),
    "two spheres": (
        sphere(0.2, WIDE),
        sphere(0.15, WIDE, Turned((0.0, 0.0, 0.12))),
        # z = (d^2 + R^2 - r^2) / (2 d)
        (0, 0, (0.0144 + 0.04 - 0.0225) / 0.24),
        np.sqrt(0.04 - ((0.0144 + 0.04 - 0.0225) / 0.24) ** 2),
    ),
    "plane, cylinder": (floor(0.1), cylinder(0.2, (-0.4, 0.4)), (0, 0, 0.1), 0.2),
    "sphere, cylinder": (
        sphere(0.2, (0.1, 1.4)),
        cylinder(0.1, (0.0, 0.4)),
        (0, 0, np.sqrt(0.03)),
        0.1,
    ),
    "plane, paraboloid": (floor(0.1), paraboloid(SQUARE, 2.0), (0, 0, 0.1), np.sqrt(0.05)),
    "plane, cone": (floor(0.1), cone(0.5, (0.05, 0.4)), (0, 0, 0.1), 0.1 * np.tan(0.5)),
    "small": (
        floor(0.1999),
        sphere(0.2, WIDE, Turned((0, 0, 0), tilted((1, 0, 0)))),
        (0, 0, 0.1999),
        np.sqrt(0.04 - 0.1999**2),
    ),
}


@pytest.mark.slow(but=["plane, sphere", "plane, cone", "sphere, cylinder"])
@pytest.mark.parametrize("name", CIRCLES)
def test_circles_are_found_as_circles(name):
    first, second, center, radius = CIRCLES[name]
    (edge,) = find_edges(first, second, smoothness=3)
    assert isinstance(edge.curve, FourierCurve)
    np.testing.assert_allclose(edge.curve.constant, center, rtol=0, atol=1e-11)
    axes = np.array([edge.curve.cosine[0], edge.curve.sine[0]])
    np.testing.assert_allclose(axes @ axes.T, radius**2 * np.eye(2), rtol=0, atol=1e-11)
    np.testing.assert_allclose(axes[:, 2], 0.0, rtol=0, atol=1e-11)


def test_an_oblique_cut_of_a_cylinder_is_an_ellipse():
    """Semi-axes r and r / cos(alpha)."""
    normal = np.array([0.5, 0.2, 1.0]) / np.sqrt(1.29)
    cut = plane(SQUARE, (0.0, 0.0, 0.05), tilted(normal))
    (edge,) = find_edges(cut, cylinder(0.2, (-0.4, 0.4)), smoothness=5)
    assert isinstance(edge.curve, FourierCurve)
    axes = np.array([edge.curve.cosine[0], edge.curve.sine[0]])
    lengths = np.linalg.svd(axes)[1]
    np.testing.assert_allclose(lengths, [0.2 / normal[2], 0.2], rtol=1e-10)
    np.testing.assert_allclose(edge.curve.constant, [0.0, 0.0, 0.05], rtol=0, atol=1e-11)


def test_two_planes_meet_in_a_line_as_long_as_both():
    other = plane(((-0.3, 0.2), (-0.5, 0.5)), (0.1, 0.0, 0.0), tilted((1.0, 0.0, 0.3)))
    (edge,) = find_edges(floor(), other, smoothness=3)
    assert edge.curve.smoothness == np.inf
    ends = edge.curve.derivatives(edge.curve.domain, 0)[:, 0]
    # along n_1 x n_2 = e_y, cut where the second one ends in its theta_1
    np.testing.assert_allclose(ends, [[0.1, -0.3, 0.0], [0.1, 0.2, 0.0]], rtol=0, atol=1e-12)


def test_a_plane_along_the_axis_cuts_a_cylinder_in_two_lines():
    edges = find_edges(
        plane(SQUARE, (0.0, 0.06, 0.0), tilted((0.0, 1.0, 0.0))),
        cylinder(0.1, (-0.3, 0.2)),
        smoothness=3,
    )
    ends = sorted(sorted(map(tuple, places(edge.curve, 2)[0])) for edge in edges)
    expected = [[(x, 0.06, -0.3), (x, 0.06, 0.2)] for x in (-0.08, 0.08)]
    np.testing.assert_allclose(ends, expected, rtol=0, atol=1e-11)


@pytest.mark.slow
def test_a_torus_is_cut_in_two_circles():
    edges = find_edges(floor(0.06), torus(0.3, 0.1), smoothness=3)
    radii = sorted(np.linalg.norm(edge.curve.cosine[0]) for edge in edges)
    np.testing.assert_allclose(radii, [0.22, 0.38], rtol=0, atol=1e-11)


# surfaces, and of both the distance of a point and the gradient of what is zero on it
AXIS = np.array([0.3, 0.1, 1.0]) / np.sqrt(1.1)


def off_paraboloid(p):
    x = p - [0.85, 0.0, 0.75]
    gradient = np.stack([-8.0 * x[:, 0], -8.0 * x[:, 1], np.ones(len(x))], axis=1)
    size = np.linalg.norm(gradient, axis=1)
    return (x[:, 2] - 4.0 * (x[:, :2] ** 2).sum(axis=1)) / size, gradient / size[:, None]


def off_cylinder(p):
    x = p - [0.87, 0.02, 0.85]
    radial = x - np.outer(x @ AXIS, AXIS)
    size = np.linalg.norm(radial, axis=1)
    return size - 0.15, radial / size[:, None]


def dish_and_tube():
    dish = paraboloid(((-0.3, 0.3), (-0.3, 0.3)), 4.0, (0.85, 0.0, 0.75))
    return dish, cylinder(0.15, (-0.4, 0.4), Turned((0.87, 0.02, 0.85), tilted(AXIS)))


@pytest.mark.slow(but="3-1e-06")
@pytest.mark.parametrize(("smoothness", "tolerance"), [(2, 1e-4), (3, 1e-6), (5, 1e-8)])
def test_a_spline_is_on_both_surfaces(smoothness, tolerance):
    """As near as asked for, along the cross product of the normals, and smooth where it closes."""
    (edge,) = find_edges(*dish_and_tube(), smoothness=smoothness, tolerance=tolerance)
    assert edge.curve.closed
    assert edge.curve.smoothness >= smoothness
    assert 0.0 < edge.deviation <= tolerance
    p, velocity = places(edge.curve, 3000)
    (off_1, n_1), (off_2, n_2) = off_paraboloid(p), off_cylinder(p)
    assert max(np.abs(off_1).max(), np.abs(off_2).max()) <= tolerance
    tangent = np.cross(n_1, n_2)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    velocity /= np.linalg.norm(velocity, axis=1, keepdims=True)
    assert np.abs(velocity - tangent).max() < 300.0 * tolerance
    begin, end = edge.curve.domain
    h = 1e-9 * (end - begin)
    sides = [edge.curve.derivatives(theta, smoothness) for theta in (begin + h, end - h)]
    scale = np.abs(edge.curve.derivatives(np.linspace(begin, end, 99), smoothness)).max(axis=(0, 2))
    assert np.all(np.abs(sides[1] - sides[0]).max(axis=1) < 1e-5 * scale)


def test_a_traced_circle_is_the_circle(monkeypatch):
    monkeypatch.setattr(edge_module, "line_or_ellipse", lambda *_: None)
    first, second, center, radius = CIRCLES["two spheres"]
    (edge,) = find_edges(first, second, smoothness=4)
    assert isinstance(edge.curve, PiecewisePolynomialCurve)
    p, velocity = places(edge.curve)
    assert np.abs(np.linalg.norm(p - center, axis=1) - radius).max() < 1e-6
    assert np.abs(p[:, 2] - center[2]).max() < 1e-6
    assert edge.curve.period == pytest.approx(2.0 * np.pi * radius, abs=1e-6)
    assert np.abs(np.linalg.norm(velocity, axis=1) - 1.0).max() < 1e-4


def test_a_tube_through_a_tube_leaves_two_edges():
    """x^2 + y^2 = R^2 and y^2 + z^2 = r^2: y = r cos t, z = r sin t, x = +-sqrt(R^2 - y^2)."""
    edges = find_edges(
        cylinder(0.1, (-0.5, 0.5)),
        cylinder(0.06, (-0.5, 0.5), Turned((0.0, 0.0, 0.0), tilted((1.0, 0.0, 0.0)))),
        smoothness=3,
    )
    assert len(edges) == 2
    for edge in edges:
        p, _ = places(edge.curve)
        angle = np.arctan2(p[:, 2], p[:, 1])
        side = np.sign(p[0, 0])
        x = side * np.sqrt(0.01 - (0.06 * np.cos(angle)) ** 2)
        exact = np.column_stack([x, 0.06 * np.cos(angle), 0.06 * np.sin(angle)])
        assert np.abs(p - exact).max() < 1e-6
        assert np.ptp(np.unwrap(angle)) == pytest.approx(2.0 * np.pi, abs=1e-6)
    assert edges[0].theta[0, 0] != edges[1].theta[0, 0]


def test_edges_end_where_a_surface_does():
    """A cut whose ellipse reaches beyond both ends of the cylinder leaves two arcs."""
    cut = plane(SQUARE, (0.0, 0.0, 0.0), tilted((0.5, 0.0, 1.0)))
    edges = find_edges(cut, cylinder(0.2, (-0.08, 0.05)), smoothness=3)
    assert len(edges) == 2
    for edge in edges:
        assert not edge.curve.closed
        ends = places(edge.curve, 2)[0]
        assert sorted(ends[:, 2]) == pytest.approx([-0.08, 0.05], abs=1e-9)
        p, _ = places(edge.curve)
        assert np.abs(np.hypot(p[:, 0], p[:, 1]) - 0.2).max() < 1e-6
        assert np.abs(p[:, 2] + 0.5 * p[:, 0]).max() < 1e-6


@pytest.mark.slow(but="1e-05")
@pytest.mark.parametrize("beyond", [1e-3, 1e-5])
def test_an_edge_that_leaves_for_a_moment_is_open(beyond):
    """Height 0.05 + 0.1 cos(angle) of an ellipse, and a tube that ends just below its top."""
    cut = plane(SQUARE, (0.0, 0.0, 0.05), tilted((-0.5, 0.0, 1.0)))
    (edge,) = find_edges(cut, cylinder(0.2, (-0.2, 0.15 - beyond)), smoothness=3)
    assert not edge.curve.closed
    p, _ = places(edge.curve)
    angles = np.sort(np.abs(np.arctan2(p[[0, -1], 1], p[[0, -1], 0])))
    np.testing.assert_allclose(angles, np.arccos(1.0 - beyond / 0.1), rtol=0, atol=1e-8)
    assert np.abs(np.hypot(p[:, 0], p[:, 1]) - 0.2).max() < 1e-6


@pytest.mark.slow
def test_a_spline_surface_crosses_a_plane_three_times():
    """A wave z = 0.05 sin(...) as a spline; the roots of its profile are known from the spline."""
    x = np.linspace(0.0, 0.6, 25)
    profile = interpolate(
        np.column_stack([x, 0.0 * x, 0.05 * np.cos(2.5 * np.pi * x / 0.6)]), smoothness=4
    )
    wave = extruded_surface(profile, (0.0, 1.0, 0.0), 0.3)
    edges = find_edges(wave, plane(((-1.0, 1.0), (-1.0, 1.0)), (0.0, 0.0, 0.01)), smoothness=3)
    fine = profile.derivatives(np.linspace(*profile.domain, 200_001), 0)[:, 0]
    crossing = np.flatnonzero(np.diff(np.sign(fine[:, 2] - 0.01)))
    found = sorted(places(edge.curve, 2)[0][0, 0] for edge in edges)
    np.testing.assert_allclose(found, fine[crossing, 0], rtol=0, atol=1e-5)
    assert all(np.ptp(places(edge.curve, 2)[0][:, 1]) == pytest.approx(0.3) for edge in edges)


@pytest.mark.slow
def test_the_edge_next_to_a_point_begins_there():
    near = np.array([-0.5, 0.2, 0.1])
    torus_cut = floor(0.06), torus(0.3, 0.1)
    edge = find_edge(*torus_cut, near=near, smoothness=3)
    nearest = near[:2] / np.linalg.norm(near[:2]) * 0.38
    begin = edge.curve.derivatives(0.0, 0)[0]
    np.testing.assert_allclose(begin, [*nearest, 0.06], rtol=0, atol=1e-7)
    dish, tube = dish_and_tube()
    begin = find_edge(dish, tube, near=near, smoothness=3).curve.derivatives(0.0, 1)
    assert abs((begin[0] - near) @ begin[1]) < 1e-6


@pytest.mark.slow
def test_an_edge_that_is_meant_may_be_had_though_others_touch():
    """A plane that cuts the outer side of a torus twice; between them it touches the tube."""
    saddle = plane(SQUARE, (0.2, 0.0, 0.0), tilted((1.0, 0.0, 0.0)))
    with pytest.raises(InputError, match="touch at"):
        find_edges(saddle, torus(0.3, 0.1), smoothness=3)
    tube = cylinder(0.03, (-0.5, 0.5), Turned((0.0, 0.3, 0.0), tilted((1.0, 0.0, 0.0))))
    assert find_edge(saddle, tube, near=(0.2, 0.3, 0.0), smoothness=3).curve.closed


REFUSED = {
    "coincide around": (
        sphere(0.2, WIDE),
        sphere(0.2, WIDE, Turned((0.0, 0.0, 0.0), tilted((1.0, 0.0, 0.0)))),
    ),
    r"touch at \[0, 0, 0.2\] m": (
        floor(0.2),
        sphere(0.2, WIDE, Turned((0.0, 0.0, 0.0), tilted((1.0, 0.0, 0.0)))),
    ),
    # along a circle
    r"touch at .*, 0\] m instead of crossing": (sphere(0.2, WIDE), cylinder(0.2, (-0.4, 0.4))),
    # two Villarceau circles cross where the plane touches the torus
    r"touch at \[0.26666\d, .*, -0.09428": (
        plane(SQUARE, (0.0, 0.0, 0.0), tilted((1.0 / 3.0, 0.0, np.sqrt(8.0) / 3.0))),
        torus(0.3, 0.1),
    ),
    # Viviani's curve crosses itself
    r"touch at \[0.2, .*, .*\] m": (
        sphere(0.2, WIDE),
        cylinder(0.1, (-0.4, 0.4), Turned((0.1, 0.0, 0.0))),
    ),
    "do not meet within their bounds, 0.2": (floor(0.4), sphere(0.2, WIDE)),
    "though they come as near as 0.0001 m": (
        floor(0.2001),
        sphere(0.2, WIDE, Turned((0.0, 0.0, 0.0), tilted((1.0, 0.0, 0.0)))),
    ),
}


@pytest.mark.slow(
    but=[
        "touch at \\\\[0.2, .*, .*\\\\] m",
        "touch at \\\\[0, 0, 0.2\\\\] m",
        "though they come as near as 0.0001 m",
        "do not meet within their bounds, 0.2",
    ]
)
@pytest.mark.parametrize("message", REFUSED)
def test_surfaces_without_an_edge_are_refused(message):
    with pytest.raises(InputError, match=message) as caught:
        find_edges(*REFUSED[message], smoothness=3)
    assert "\n" not in str(caught.value)


def test_numbers_that_are_none_are_refused():
    with pytest.raises(InputError, match=r"tolerance: 0\.0 m"):
        find_edges(floor(), sphere(0.2, WIDE), smoothness=3, tolerance=0.0)
    with pytest.raises(InputError, match=r"near: \[nan"):
        find_edge(floor(), sphere(0.2, WIDE), smoothness=3, near=(np.nan, 0.0, 0.0))
