"""Pieces of boundaries: their bounds hold, and the search misses no closest point."""

from typing import NamedTuple

import casadi as ca
import numpy as np
import pytest
from scipy.spatial import cKDTree

from pfsc_drake.geometry import interpolate, surface_through_grid, torus
from pfsc_drake.geometry.regions import plane_curve, surface_region
from pfsc_drake.geometry.regions.pieces import ClosestBoundaryPoint, Pieces, closest_boundary_point
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


@pytest.mark.slow(but=["torus", "saddle"])
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
    edges = plane_curve._edges(curve)
    points = curve.derivatives(_within(edges, 20), 0)[:, None, :, 0]
    _assert_bounded(plane_curve._pieces(curve, edges), points)


class _PlaceFoot(NamedTuple):
    distance: float
    piece: tuple[int, int] | None
    below: bool = False


def _closest(point, number, distance, piece, below):
    """Return an expression of a minimum for `closest_boundary_point`."""
    return ca.Function("foot", [point, number], [ca.vertcat(distance, piece, below)])


@pytest.mark.parametrize("bulging", range(0, 32, 3))
def test_a_piece_may_bulge_far_from_its_disc(bulging):
    """32 pieces in a row, a metre apart; one reaches 16 m to a place beside another's middle."""
    count = 32
    centre, normal = np.zeros((count, 1, 3)), np.tile([0.0, 0.0, 1.0], (count, 1, 1))
    centre[:, 0, 0] = np.arange(count)
    places = centre[:, 0].copy()
    places[bulging] = ((bulging + 16) % count, 0.0, 0.03)
    sag = np.zeros((count, 1))
    sag[bulging] = 16.1
    radius, bends = np.zeros((count, 1)), np.zeros((2, count, 1))

    def project(x, y, z, row, column):
        return _PlaceFoot(float(np.linalg.norm(places[row] - (x, y, z))), None)

    pieces = Pieces(centre, normal, radius, sag, bends, (False, False))
    x, y, z = places[bulging] - [0.0, 0.0, 0.01]
    assert ClosestBoundaryPoint(pieces, project)(x, y, z).distance == pytest.approx(0.01)
    point, number = ca.MX.sym("point", 3), ca.MX.sym("number")
    away = ca.norm_2(ca.MX(ca.DM(places).T)[:, number] - point)
    expression = closest_boundary_point(pieces, _closest(point, number, away, -1.0, 0.0))
    assert float(expression([x, y, z])[0]) == pytest.approx(0.01)


@pytest.mark.parametrize("below", [False, True])
def test_a_closest_point_hides_its_neighbours_only_where_the_boundary_bends_away(below):
    """A trough from above: from beyond its centres of curvature another minimum may be beside one.

    From below, where it bends away, there is none, and none is looked for.
    """
    count = 32
    centre, normal = np.zeros((count, 1, 3)), np.tile([0.0, 0.0, 1.0], (count, 1, 1))
    centre[:, 0, 0] = 0.1 * np.arange(count)
    bends = np.stack([np.full((count, 1), 2.0), np.full((count, 1), -2.0)])
    radius, sag = np.full((count, 1), 0.05), np.full((count, 1), 2.0)
    tried = []

    def project(x, y, z, row, column):
        tried.append(row)
        return _PlaceFoot(0.5 if row == 11 and not below else 1.0, (row, 0), below)

    pieces, y = Pieces(centre, normal, radius, sag, bends, (False, False)), -1.0 if below else 1.0
    closest_point = ClosestBoundaryPoint(pieces, project)(1.02, 0.0, y)
    assert tried[0] == 10
    assert closest_point.distance == (1.0 if below else 0.5)
    assert not below or not {8, 9, 11, 12} & set(tried)
    point, number = ca.MX.sym("point", 3), ca.MX.sym("number")
    found = _closest(point, number, ca.if_else(number == 11, 0.5, 1.0), number, float(below))
    # what is hidden is not tried, whatever it would be
    expression = closest_boundary_point(pieces, found)
    assert float(expression([1.02, 0.0, y])[0]) == (1.0 if below else 0.5)


@pytest.mark.slow
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
