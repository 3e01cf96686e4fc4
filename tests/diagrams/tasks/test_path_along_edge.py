"""Paths along the edge of two surfaces, as scenarios say them."""

import numpy as np
import pytest

from diagrams.scenario import Intersection, PathParameters
from diagrams.tasks.task_geometry import make_path
from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.geometry.shapes.plane import Plane
from pfsc_drake.geometry.shapes.profiles import Extruded
from pfsc_drake.geometry.shapes.sphere import Sphere
from pfsc_drake.geometry.shapes.torus import Torus


def make(shape, law="rigid", folder=None):
    return make_path(PathParameters(shape), law, folder)


@pytest.mark.slow(but=["elastic", "rigid"])
@pytest.mark.parametrize("law", RELATIVE_DEGREE)
def test_the_edge_is_as_smooth_as_the_law_needs(law):
    ball = Sphere([0.0, 0.0, 0.02], radius=0.35, latitudes_deg=[-40.0, 40.0])
    ring = Torus([0.3, 0.0, 0.0], axis=[0.0, 1.0, 0.2])
    path = make(Intersection([ball, ring], near=[0.3, 0.0, 0.2]), law)
    assert path.position.smoothness >= RELATIVE_DEGREE[law] + 1
    p = path.position.derivatives(np.linspace(*path.position.domain, 300), 0)[:, 0]
    assert np.abs(np.linalg.norm(p - [0.0, 0.0, 0.02], axis=1) - 0.35).max() < 1e-6
    axis = np.array([0.0, 1.0, 0.2]) / np.sqrt(1.04)
    height = (p - [0.3, 0.0, 0.0]) @ axis
    ring_distance = np.linalg.norm(p - [0.3, 0.0, 0.0] - np.outer(height, axis), axis=1) - 0.3
    assert np.abs(np.hypot(ring_distance, height) - 0.1).max() < 1e-6


@pytest.mark.slow
def test_near_tells_which_edge_is_meant():
    cut = Plane(first=[-0.5, 0.5], second=[-0.5, 0.5], origin=[0.0, 0.0, 0.06])
    for near, radius in (([0.1, 0.0, 0.0], 0.22), ([0.5, 0.0, 0.0], 0.38)):
        path = make(Intersection([cut, Torus()], near=near))
        assert path.closed
        assert path.length == pytest.approx(2.0 * np.pi * radius)
        np.testing.assert_allclose(path.pose(0.0)[0], [radius, 0.0, 0.06], rtol=0, atol=1e-7)


def test_surfaces_may_come_from_files(tmp_path):
    x = np.linspace(0.0, 0.4, 15)
    lines = [f"{value!r},0.0,{value**2!r}" for value in x.tolist()]
    (tmp_path / "profile.csv").write_text("\n".join(["x,y,z", *lines]), encoding="utf-8")
    sheet = Extruded(file="profile.csv", direction=[0.0, 1.0, 0.0], length=0.3)
    wall = Plane(first=[-1.0, 1.0], second=[-1.0, 1.0], axis=[-1.0, 1.0, 0.0])
    path = make(Intersection([sheet, wall]), folder=tmp_path)
    p = path.position.derivatives(np.linspace(*path.position.domain, 100), 0)[:, 0]
    # y = x, z = x^2, as far as y = 0.3
    assert np.abs(p[:, 1] - p[:, 0]).max() < 1e-6
    assert np.abs(p[:, 2] - p[:, 0] ** 2).max() < 2e-6
    assert p[:, 0].max() == pytest.approx(0.3)
