"""Swept surfaces: on the cross-section, with normals out of the material, without gaps."""

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import FourierCurve, PiecewisePolynomialCurve
from pfsc_drake.geometry.workpiece_bodies import swept_surface

UP = np.array([0.0, 0.0, 1.0])
TENT = np.array([[0.2, -0.1], [0.0, 0.05], [-0.2, -0.1]])


def normals(vertices, triangles):
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    return np.cross(b - a, c - a)


def test_a_flat_strip_along_a_line():
    line = PiecewisePolynomialCurve.line([1.0, 0.0, 0.5], [3.0, 0.0, 0.5])
    flat = np.array([[0.3, 0.1], [-0.2, 0.1]])
    vertices, triangles = swept_surface(line, np.linspace(*line.domain, 5), flat, UP)
    # moving along x with z up, left is y
    assert set(np.round(vertices[:, 1], 12)) == {0.3, -0.2}
    assert np.allclose(vertices[:, 2], 0.6)
    assert np.allclose(vertices[:, 0].reshape(5, 2), np.linspace(1.0, 3.0, 5)[:, None])
    area = normals(vertices, triangles)
    assert np.all(area[:, 2] > 0.0) and np.allclose(area[:, :2], 0.0)
    assert 0.5 * np.linalg.norm(area, axis=1).sum() == pytest.approx(2.0 * 0.5)


def test_a_ring_keeps_its_cross_section():
    circle = FourierCurve.circle([0, 0, 1], 0.5, [1, 0, 0], [0, 1, 0])
    theta = np.linspace(*circle.domain, 41)
    vertices, triangles = swept_surface(circle, theta, TENT, UP)
    # counter-clockwise about z: left points to the axis
    radius = np.linalg.norm(vertices[:, :2], axis=1).reshape(-1, 3)
    assert np.allclose(radius, 0.5 - TENT[:, 0])
    assert np.allclose(vertices[:, 2].reshape(-1, 3), 1.0 + TENT[:, 1])
    # a tent is outside above
    assert np.all(normals(vertices, triangles)[:, 2] > 0.0)


def test_every_inner_edge_belongs_to_two_triangles():
    line = PiecewisePolynomialCurve.line([0.0, 0.0, 0.0], [1.0, 0.2, 0.1])
    _, triangles = swept_surface(line, np.linspace(*line.domain, 4), TENT, UP)
    assert triangles.shape == (2 * 3 * 2, 3)
    edges = [tuple(pair) for t in triangles.tolist() for pair in zip(t, t[1:] + t[:1], strict=True)]
    # no edge is passed twice in the same direction
    assert len(set(edges)) == len(edges)
    border = [edge for edge in edges if edge[::-1] not in edges]
    assert len(border) == 2 * 3 + 2 * 2


@pytest.mark.parametrize(
    ("theta", "profile", "up", "part"),
    [
        ([0.0, 1.0], [[0.0, 0.0]], UP, "profile: shape (1, 2)"),
        ([0.0, 1.0], [[0.0, 0.0, 1.0], [1.0, 1.0, 1.0]], UP, "profile: shape (2, 3)"),
        ([0.0], TENT, UP, "theta: [0.0]"),
        ([0.0, 0.0], TENT, UP, "theta: [0.0, 0.0]"),
        ([0.0, 1.0], TENT, [1.0, 0.0, 0.0], "runs along it"),
    ],
)
def test_refused(theta, profile, up, part):
    line = PiecewisePolynomialCurve.line([0.0, 0.0, 0.0], [1.0, 0.0, 0.0])
    with pytest.raises(InputError) as caught:
        swept_surface(line, np.array(theta), np.array(profile), np.array(up))
    assert part in str(caught.value)
