"""Wedges around a bore."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.workpiece_bodies import bore_wedges

RADIUS, RING, DEPTH, COUNT = 4.15e-3, 16e-3, 10e-3, 24
WEDGES = bore_wedges(RADIUS, RING, DEPTH, COUNT)


def signed_distances(wedge, points):
    """Return how far points are outside of the farthest face of a convex body."""
    planes = ConvexHull(wedge).equations
    return (points @ planes[:, :3].T + planes[:, 3]).max(axis=1)


def test_they_are_convex_with_all_their_corners():
    for wedge in WEDGES:
        assert len(ConvexHull(wedge).vertices) == 8


def test_the_bore_is_never_narrower_and_hardly_wider():
    """Rays from the axis, half way down, meet material between the circle and the corners."""
    angles = np.linspace(0.0, 2.0 * np.pi, 361)
    radii = np.linspace(0.9 * RADIUS, 1.1 * RADIUS, 401)
    rays = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=-1)
    points = radii[:, np.newaxis, np.newaxis] * rays + [0.0, 0.0, DEPTH / 2.0]
    outside = np.min([signed_distances(w, points.reshape(-1, 3)) for w in WEDGES], axis=0)
    solid = (outside.reshape(points.shape[:2]) <= 1e-12).argmax(axis=0)
    first = radii[solid]
    step = radii[1] - radii[0]
    assert first.min() >= RADIUS - 1e-12
    assert first.max() <= RADIUS / np.cos(np.pi / COUNT) + step


def test_around_it_there_is_no_gap():
    random = np.random.default_rng(0)
    angle, radius = random.uniform(0.0, 2.0 * np.pi, 500), random.uniform(1.01 * RADIUS, RING, 500)
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(500, 1e-4)])
    outside = np.min([signed_distances(wedge, points) for wedge in WEDGES], axis=0)
    assert outside.max() <= 1e-12


@pytest.mark.parametrize(
    ("numbers", "part"),
    [
        ((RING, RADIUS, DEPTH, COUNT), "radius"),
        ((0.0, RING, DEPTH, COUNT), "radius"),
        ((RADIUS, RING, 0.0, COUNT), "depth"),
        ((RADIUS, RING, DEPTH, 7), "7 wedges"),
    ],
)
def test_wrong_numbers_are_refused(numbers, part):
    with pytest.raises(InputError, match=part):
        bore_wedges(*numbers)
