"""Regions bounded by any surface."""

import math
from bisect import bisect_right
from typing import NamedTuple, NoReturn

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.regions.pieces import NearestFoot, Pieces
from pfsc_drake.geometry.regions.region import Distance, Region
from pfsc_drake.geometry.surfaces.curvature import fundamental_forms
from pfsc_drake.geometry.surfaces.partials import partial_index
from pfsc_drake.geometry.surfaces.projection import Pair, SurfaceProjector
from pfsc_drake.geometry.surfaces.regularity import sample_grid
from pfsc_drake.geometry.surfaces.surface import Surface

# Of the normal on a piece, rad, as far as these numbers of pieces in a direction allow.
_TURNING = 0.12
_FEWEST_PIECES, _MOST_PIECES = 16, 192
# Samples along a piece by which its bend is bounded.
_SAMPLES = 3


class _SurfaceFoot(NamedTuple):
    distance: float
    piece: tuple[int, int] | None
    below: bool
    signed: Distance


class SurfaceRegion(Region):
    """What lies on one side of a surface, a spline fit for instance.

    The foot is the nearest point of the whole surface: pieces of it, whose bends are bounded from
    samples, are ruled out unless they may be nearer than what Newton's method has found.

    An open surface is a sheet that ends at its border. Where the border is the nearest, the
    distance is that from it, positive, and the gradient points away from it: what the surface does
    not cover is admissible. So a tool that goes round the border is suddenly deep on the wrong
    side; other regions have to keep it from there.

    Args:
        surface: Surface of class C^2, of class C^3 between its breakpoints, a single sheet.
        above: Whether the admissible side is the one that the normal (4.3) points to.

    Raises:
        InputError: The surface is not regular.
    """

    def __init__(self, surface: Surface, *, above: bool) -> None:
        self._surface = surface
        self._sign = 1.0 if above else -1.0
        edges = _edges(surface)
        self._middles = [(0.5 * (values[1:] + values[:-1])).tolist() for values in edges]
        self._inner = [values[1:-1].tolist() for values in edges]
        self._sample = surface.flat_sampler(1)
        self._projector = SurfaceProjector(surface)
        self._nearest = NearestFoot(_pieces(surface, edges), self._project)

    @property
    def signed_distance(self) -> NoReturn:
        """See the base class."""
        raise InputError(
            "fitted surface: its nearest place is searched for, in as many steps as that takes; no"
            " formula has it"
        )

    def distance(self, x: float, y: float, z: float) -> Distance:
        """See the base class."""
        return self._nearest(x, y, z).signed

    def _project(self, x: float, y: float, z: float, row: int, column: int) -> _SurfaceFoot:
        guess = (self._middles[0][row], self._middles[1][column])
        foot = self._projector.project((x, y, z), guess)
        a, b, c, ux, uy, uz, vx, vy, vz = self._sample(*foot.theta).tolist()
        a, b, c = x - a, y - b, z - c
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        length = math.sqrt(nx * nx + ny * ny + nz * nz)
        along = (a * nx + b * ny + c * nz) / length
        away = math.sqrt(a * a + b * b + c * c)
        if away and (foot.at_border or not foot.converged):
            # along the way from the foot, which a normal is not
            side = 1.0 if foot.at_border else math.copysign(1.0, along * self._sign)
            scale = side / away
            signed = side * away, scale * a, scale * b, scale * c
        else:
            scale = self._sign / length
            signed = self._sign * along, scale * nx, scale * ny, scale * nz
        piece = None if foot.at_border else self._piece(foot.theta)
        return _SurfaceFoot(away, piece, bool(along < 0.0), signed)

    def _piece(self, theta: Pair) -> tuple[int, int]:
        first, second = (
            bisect_right(inner, value if begin <= value <= end else _wrapped(value, begin, end))
            for inner, value, (begin, end) in zip(
                self._inner, theta, self._surface.domain, strict=True
            )
        )
        return first, second


def normal_points_outwards(surface: Surface) -> bool:
    """Whether the normal (4.3) of a surface that is closed in both directions points outwards.

    By the sign of the volume that it encloses, the surface integral of sigma . e_perp / 3.
    """
    grid = sample_grid(surface)
    position, first, second = np.moveaxis(surface.partials(grid.theta, 1), -2, 0)
    about = position - position.mean(axis=(0, 1))
    cells = [
        np.diff(np.append(theta, ends.end))
        for theta, ends in zip((grid.theta_1, grid.theta_2), surface.domain, strict=True)
    ]
    density = np.sum(about * np.cross(first, second), axis=-1)
    return bool(np.einsum("ij,i,j->", density, *cells) > 0.0)


def _wrapped(value: float, begin: float, end: float) -> float:
    return begin + (value - begin) % (end - begin)


def _edges(surface: Surface) -> list[np.ndarray]:
    """Lines between pieces, one or more in each cell, on which the normal turns little."""
    grid = sample_grid(surface)
    edges = []
    for axis, theta in enumerate((grid.theta_1, grid.theta_2)):
        turning = float(grid.turning(axis).max())
        wanted = math.ceil(len(theta) * turning / _TURNING)
        fewest = min(max(wanted, _FEWEST_PIECES), _MOST_PIECES)
        lines = surface.grid(1, fewest)[axis]
        edges.append(np.append(lines, surface.domain[axis].end) if surface.closed[axis] else lines)
    return edges


def _pieces(surface: Surface, edges: list[np.ndarray]) -> Pieces:
    """Pieces of a surface between the lines of a grid."""
    fine = [np.sort(np.concatenate([e, 0.5 * (e[1:] + e[:-1])])) for e in edges]
    theta = np.stack(np.meshgrid(*fine, indexing="ij"), axis=-1)
    partials = surface.partials(theta, 3)
    half = [0.5 * np.diff(e) for e in edges]
    a, b = half[0][:, None], half[1][None, :]
    size = np.linalg.norm(partials, axis=-1)

    def largest(*order: int) -> np.ndarray:
        """Largest derivative of an order among a piece's samples, [n_1, n_2]."""
        return _over_pieces(size[..., partial_index(*order)])

    # no place is further from a sample than half of the way between two
    second_order = {
        order: largest(*order)
        + 0.5 * a * largest(order[0] + 1, order[1])
        + 0.5 * b * largest(order[0], order[1] + 1)
        for order in ((2, 0), (1, 1), (0, 2))
    }
    sag = 0.5 * (
        second_order[2, 0] * a**2 + 2.0 * second_order[1, 1] * a * b + second_order[0, 2] * b**2
    )
    centre, first, second = np.moveaxis(partials[1::2, 1::2, :3], 2, 0)
    a, b = a[..., None], b[..., None]
    corners = [np.linalg.norm(a * first + s * b * second, axis=-1) for s in (-1.0, 1.0)]
    normal = np.cross(first, second)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    largest_bend, least_bend = fundamental_forms(surface, theta).principal_curvatures
    bends = np.stack([_over_pieces(largest_bend), _over_pieces(-least_bend)])
    return Pieces(centre, normal, np.maximum(*corners), sag, bends, surface.closed)


def _over_pieces(values: np.ndarray) -> np.ndarray:
    """Largest value among the samples of each piece, its edges included, [n_1, n_2]."""
    rows = np.max([values[k : len(values) - 2 + k : 2] for k in range(_SAMPLES)], axis=0)
    return np.asarray(
        np.max([rows[:, k : rows.shape[1] - 2 + k : 2] for k in range(_SAMPLES)], axis=0)
    )
