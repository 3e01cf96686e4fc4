"""Pieces of boundaries: their bounds hold, and the search misses no foot."""

from typing import NamedTuple

import numpy as np
import pytest
from scipy.spatial import cKDTree

from pfsc_drake.geometry import interpolate, surface_through_grid, torus
from pfsc_drake.geometry.regions import profile, surface_region
from pfsc_drake.geometry.regions.pieces import NearestFoot, Pieces
from pfsc_drake.geometry.regions.surface_region import SurfaceRegion


def _rough(seed, height):
    """A surface through random heights 5 cm apart, of class C^2."""
    x, y = np.meshgrid(np.linspace(-0.4, 0.4, 17), np.linspace(-0.3, 0.3, 13), indexing="ij")
    heights = height * np.random.default_rng(seed).normal(size=x.shape)
    return surface_through_grid(np.stack([x, y, heights], axis=-1), smoothness=2)


def _assert_bounded(pieces, points):
    """Points of each piece, [n_1, n_2, m, 3], lie within its sag of its disc."""
    away = points - pieces.centre[:, :, None]
    height = np.sum(away * pieces.normal[:, :, None], axis=-1)
    aside = np.sqrt(np.maximum(np.sum(away**2, axis=-1) - height**2, 0.0))
    aside = np.maximum(aside - pieces.radius[..., None], 0.0)
    over = np.hypot(height, aside) / pieces.sag[..., None]
    assert over.max() <= 1.0 + 1e-9
    # the bounds are not much too wide, either
    assert np.median(over.max(axis=-1)) > 0.2


def _within(edges, count):
    return edges[:-1, None] + np.diff(edges)[:, None] * np.linspace(0.0, 1.0, count)


def _saddle():
    """Z = x y: its second derivatives along the parameters are zero, it only twists."""
    x, y = np.meshgrid(np.linspace(-0.4, 0.4, 9), np.linspace(-0.3, 0.3, 7), indexing="ij")
    return surface_through_grid(np.stack([x, y, x * y], axis=-1), smoothness=2)


@pytest.mark.parametrize(
    "surface", [torus(0.3, 0.1), _rough(3, 0.02), _saddle()], ids=["torus", "rough", "saddle"]
)
def test_pieces_of_a_surface_are_within_their_bounds(surface):
    edges = surface_region._edges(surface)
    first, second = (_within(values, 6) for values in edges)
    theta = np.empty((len(first), len(second), 6, 6, 2))
    theta[..., 0], theta[..., 1] = first[:, None, :, None], second[None, :, None, :]
    points = surface.partials(theta, 0)[..., 0, :].reshape(len(first), len(second), 36, 3)
    _assert_bounded(surface_region._pieces(surface, edges), points)


def test_pieces_of_a_profile_are_within_their_bounds():
    angle = np.linspace(0.0, 2.0 * np.pi, 14)[:-1]
    radius = 0.2 + 0.07 * np.random.default_rng(2).normal(size=13)
    flat = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.0 * angle], axis=1)
    curve = interpolate(flat, smoothness=2, closed=True)
    edges = profile._edges(curve)
    points = curve.derivatives(_within(edges, 20), 0)[:, None, :, 0]
    _assert_bounded(profile._pieces(curve, edges), points)


class _PlaceFoot(NamedTuple):
    distance: float
    piece: tuple[int, int] | None
    below: bool = False


@pytest.mark.parametrize("bulging", range(32))
def test_a_piece_may_bulge_far_from_its_disc(bulging):
    """32 points in a row, one of which belongs to a piece whose sag is half of their distance.

    The place beside the query is on that piece, however far its centre is.
    """
    count = 32
    centre = np.zeros((count, 1, 3))
    centre[:, 0, 0] = np.arange(count)
    normal = np.tile([0.0, 0.0, 1.0], (count, 1, 1))
    sag = np.zeros((count, 1))
    sag[bulging] = 3.0
    pieces = Pieces(
        centre, normal, np.zeros((count, 1)), sag, np.zeros((2, count, 1)), (False,) * 2
    )
    places = centre[:, 0].copy()
    places[bulging, 2] = 3.0

    def project(x, y, z, row, column):
        return _PlaceFoot(float(np.linalg.norm(places[row] - (x, y, z))), None)

    query = (float(bulging), 0.0, 2.9)
    assert NearestFoot(pieces, project)(*query).distance == pytest.approx(0.1)


@pytest.mark.parametrize(("seed", "height"), [(0, 0.01), (1, 0.04)])
def test_no_sample_of_a_rough_surface_is_nearer(seed, height):
    """Of 360,000 for 400 points, half of them beside the surface."""
    surface = _rough(seed, height)
    region = SurfaceRegion(surface, above=True)
    theta = np.stack(
        np.meshgrid(*[np.linspace(*ends, 600) for ends in surface.domain], indexing="ij"), axis=-1
    ).reshape(-1, 2)
    places = surface.partials(theta, 0)[:, 0]
    rng = np.random.default_rng(5)
    beside = places[rng.integers(len(places), size=200)] + 5e-3 * rng.normal(size=(200, 3))
    points = np.concatenate([beside, rng.uniform(-0.5, 0.5, size=(200, 3))])
    sampled, _ = cKDTree(places).query(points)
    distances = np.abs([region.distance(*point)[0] for point in points.tolist()])
    assert np.all(distances <= sampled + 1e-12)
    # and there is a place of the surface so near: a sample is not further from it than 3 mm
    assert np.all(distances >= sampled - 3e-3)
