"""Triangles of surfaces against the surfaces themselves."""

import numpy as np
import pytest

from pfsc_drake.geometry.shapes.cylinder import cylinder
from pfsc_drake.geometry.shapes.paraboloid import paraboloid
from pfsc_drake.geometry.shapes.revolution import Turned
from pfsc_drake.geometry.workpiece_bodies import surface_mesh

SPACING = 5e-3


@pytest.mark.parametrize("coefficient", [-1.0, 0.0, 2.0])
def test_vertices_are_on_the_graph(coefficient):
    surface = paraboloid(((-0.1, 0.05), (-0.02, 0.08)), coefficient, origin=(0.3, 0.2, 0.1))
    vertices, _ = surface_mesh(surface, SPACING)
    x, y, z = (vertices - [0.3, 0.2, 0.1]).T
    np.testing.assert_allclose(z, coefficient * (x**2 + y**2), atol=1e-14)
    assert (x.min(), x.max()) == pytest.approx((-0.1, 0.05))
    assert (y.min(), y.max()) == pytest.approx((-0.02, 0.08))


def test_triangles_are_small_and_turn_about_the_normal():
    surface = paraboloid(((-0.1, 0.1), (-0.1, 0.1)), 1.5)
    vertices, triangles = surface_mesh(surface, SPACING)
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    assert np.cross(b - a, c - a)[:, 2].min() > 0.0  # the graph's normal points up
    assert max(np.linalg.norm(d, axis=1).max() for d in (b - a, c - b, a - c)) < 2.0 * SPACING


def test_a_closed_surface_has_all_of_its_area():
    radius, height = 0.08, 0.3
    vertices, triangles = surface_mesh(cylinder(radius, (0.0, height), Turned()), SPACING)
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    cross = np.cross(b - a, c - a)
    area = 0.5 * np.linalg.norm(cross, axis=1).sum()
    assert area == pytest.approx(2.0 * np.pi * radius * height, rel=1e-3)
    assert np.min(np.sum(cross * a * [1.0, 1.0, 0.0], axis=1)) > 0.0  # outwards
