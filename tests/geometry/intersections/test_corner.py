"""Corners of three surfaces against algebra."""

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    Turned,
    cylinder,
    find_corners,
    plane,
    rotation_from_axes,
    sphere,
    torus,
)

SQUARE = ((-0.5, 0.5), (-0.5, 0.5))
WIDE = (-1.2, 1.2)


def wall(origin, normal):
    start = (1.0, 0.1, 0.0) if abs(normal[0]) < 0.9 else (0.0, 1.0, 0.0)
    return plane(SQUARE, origin, rotation_from_axes(normal, start))


def ball(height):
    turned = Turned((0.0, 0.3, height), rotation_from_axes((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    return sphere(0.1, WIDE, turned)


@pytest.mark.parametrize("seed", range(5))
def test_three_planes(seed):
    generator = np.random.default_rng(seed)
    normals = np.eye(3) + 0.2 * generator.standard_normal((3, 3))
    origins = 0.1 * generator.standard_normal((3, 3))
    expected = np.linalg.solve(normals, np.sum(normals * origins, axis=1))
    corners = find_corners(*(wall(*each) for each in zip(origins, normals, strict=True)))
    np.testing.assert_allclose(corners, [expected], rtol=0, atol=1e-11)


def test_two_planes_and_a_sphere_have_two_corners():
    """On x = 0.05, z = 0.1 + 0.3 y: a quadratic equation for y."""
    corners = find_corners(
        wall((0.05, 0.0, 0.0), (1.0, 0.0, 0.0)),
        wall((0.0, 0.0, 0.1), (0.0, -0.3, 1.0)),
        sphere(0.2, WIDE),
    )
    y = np.sort(np.roots([1.09, 0.06, 0.05**2 + 0.1**2 - 0.04]))
    expected = np.column_stack([np.full(2, 0.05), y, 0.1 + 0.3 * y])
    np.testing.assert_allclose(corners, expected, rtol=0, atol=1e-11)


def test_a_line_through_a_torus_has_four():
    """At y = 0.05, z = 0.03 the distance from the axis is R +- sqrt(r^2 - z^2)."""
    corners = find_corners(
        wall((0.0, 0.05, 0.0), (0.0, 1.0, 0.0)),
        wall((0.0, 0.0, 0.03), (0.0, 0.0, 1.0)),
        torus(0.3, 0.1),
    )
    rho = 0.3 + np.array([-1.0, 1.0]) * np.sqrt(0.01 - 0.0009)
    x = np.sqrt(rho**2 - 0.05**2)
    expected = [[value, 0.05, 0.03] for value in (-x[1], -x[0], x[0], x[1])]
    np.testing.assert_allclose(corners, expected, rtol=0, atol=1e-11)


def test_three_round_surfaces():
    """Steinmetz: cylinders of one radius about all axes have eight corners r (+-1, ..) / sqrt 2."""
    tubes = [
        cylinder(0.1, (-0.3, 0.3), Turned((0.0, 0.0, 0.0), rotation_from_axes(axis, start)))
        for axis, start in zip(np.eye(3), np.roll(np.eye(3), 1, axis=0), strict=True)
    ]
    corners = find_corners(*tubes)
    signs = np.array(np.meshgrid(*[[-1, 1]] * 3, indexing="ij")).reshape(3, -1).T
    np.testing.assert_allclose(corners, 0.1 / np.sqrt(2.0) * signs, rtol=0, atol=1e-10)


def test_corners_beyond_the_bounds_do_not_count():
    corners = find_corners(
        wall((0.05, 0.0, 0.0), (1.0, 0.0, 0.0)),
        plane(((-0.5, 0.5), (0.0, 0.5)), (0.0, 0.0, 0.1)),
        sphere(0.2, WIDE),
    )
    np.testing.assert_allclose(corners, [[0.05, np.sqrt(0.0275), 0.1]], rtol=0, atol=1e-11)


@pytest.mark.slow(but=["third1-touches the third", "third3-do not meet within their bounds, 0.2"])
@pytest.mark.parametrize(
    ("third", "message"),
    [
        (ball(0.1), r"touches the third at \[0, 0.3, 0\] m"),
        (wall((0.0, 0.0, 0.0), (1.0, 0.0, 1.0)), "touches the third"),
        (ball(0.1001), "come as near as"),
        (ball(0.5), "do not meet within their bounds, 0.2"),
    ],
)
def test_no_corner_is_refused(third, message):
    with pytest.raises(InputError, match=message):
        find_corners(
            wall((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)), wall((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), third
        )
