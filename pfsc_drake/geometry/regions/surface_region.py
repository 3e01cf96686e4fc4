"""Regions bounded by any surface."""

import math
from typing import NamedTuple

import casadi as ca
import numpy as np

from pfsc_drake.compiled.bound_function import PlainFunction
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.closest_point import ClosestPointFinder
from pfsc_drake.geometry.regions.pieces import (
    ON_NO_PIECE,
    ClosestBoundaryPoint,
    Pieces,
    closest_boundary_point,
)
from pfsc_drake.geometry.regions.region import Distance, FormulaRegion, Symbol, direction
from pfsc_drake.geometry.surfaces.curvature import fundamental_forms
from pfsc_drake.geometry.surfaces.extended import SurfaceTable
from pfsc_drake.geometry.surfaces.parametric_surface import Surface, partial_index
from pfsc_drake.geometry.surfaces.regularity import sample_grid
from pfsc_drake.geometry.surfaces.surface_projection import LONGEST_STEP

# Of the normal on a piece, rad, as far as these numbers of pieces in a direction allow.
_TURNING = 0.12
_FEWEST_PIECES, _MOST_PIECES = 16, 192
# Pieces that a formula bounds one by one, which takes 0.05 us each, and some of them again.
_MOST_IN_FORMULA = 512
# Samples along a piece by which its bend is bounded.
_SAMPLES = 3


class _SurfacePoint(NamedTuple):
    distance: float
    piece: tuple[int, int] | None
    below: bool
    signed: Distance


class SurfaceRegion(FormulaRegion):
    """Region on one side of a surface, such as a spline fit.

    The distance is to the closest point of the whole surface: its pieces, whose curvature is
    bounded from samples, are ruled out unless they may be nearer than the best point found.

    An open surface is a sheet that ends at its border. Where the border is nearest, h is the
    distance to the border, positive, and the gradient points away from it: space beside the surface
    is admissible. A tool that goes around the border is suddenly deep on the wrong side; other
    regions have to prevent that.

    Args:
        surface: Surface of class C^2, of class C^3 between its breakpoints, a single sheet.
        above: Whether the admissible side is the one that the normal (4.3) points to.

    Raises:
        InputError: The surface is not regular.
    """

    symbol = ca.MX

    def __init__(self, surface: Surface, *, above: bool) -> None:
        edges = _edges(surface)
        self._pieces = _pieces(surface, edges)
        self._closest = _closest_on_piece(surface, edges, 1.0 if above else -1.0)
        self._project = PlainFunction(self._closest)
        self._nearest = ClosestBoundaryPoint(self._pieces, self._closest_near)

    def distance(self, x: float, y: float, z: float) -> Distance:
        """Return the signed distance to the boundary, positive in the admissible region."""
        return self._nearest(x, y, z).signed

    def formula(self, point: Symbol) -> tuple[Symbol, Symbol]:
        """Return the signed distance and normal as expressions.

        Raises:
            InputError: The surface has too many pieces.
        """
        count = self._pieces.radius.size
        if count > _MOST_IN_FORMULA:
            raise InputError(
                f"surface of {count} pieces: the nearest is searched for in a tree of them; a"
                f" formula has at most {_MOST_IN_FORMULA}"
            )
        closest_point = closest_boundary_point(self._pieces, self._closest)(point)
        return closest_point[3], closest_point[4:]

    def _closest_near(self, x: float, y: float, z: float, row: int, column: int) -> _SurfacePoint:
        columns = self._pieces.radius.shape[1]
        away, piece, below, *signed = self._project(x, y, z, row * columns + column)
        cell = None if piece == ON_NO_PIECE else divmod(int(piece), columns)
        return _SurfacePoint(away, cell, bool(below), tuple(signed))


def _closest_on_piece(surface: Surface, edges: list[np.ndarray], sign: float) -> ca.Function:
    """Return ``(point, number) -> minimum``, see :func:`closest_boundary_point`, shape (7,).

    Its further quantities are h and n.

    Args:
        surface: The surface.
        edges: Lines between pieces in both directions.
        sign: 1 if the side that the normal (4.3) points to is admissible, -1 if the other one is.
    """
    point, number = ca.MX.sym("point", 3), ca.MX.sym("number")
    table, columns = SurfaceTable(surface), len(edges[1]) - 1
    finder = ClosestPointFinder(
        lambda theta: table(theta, 2), surface.domain, surface.closed, LONGEST_STEP
    )
    row = ca.floor(number / columns)
    middles = [ca.MX(ca.DM(0.5 * (e[1:] + e[:-1]))) for e in edges]
    closest_point = finder.find(
        point, ca.vertcat(middles[0][row], middles[1][number - row * columns])
    )
    position, first, second = ca.horzsplit(table(closest_point.theta, 1))
    normal = ca.cross(first, second)
    normal = normal / ca.norm_2(normal)
    along = ca.dot(point - position, normal)
    away, outwards = direction(point - position, (0.0, 0.0, 0.0))
    # beside the border, the direction from the closest point
    side = ca.if_else(closest_point.beyond_end, 1.0, ca.copysign(1.0, sign * along))
    is_normal = ca.logic_or(
        away == 0.0, ca.logic_and(closest_point.converged, ca.logic_not(closest_point.beyond_end))
    )
    cells = []
    for k, ((begin, end), lines) in enumerate(zip(surface.domain, edges, strict=True)):
        revolutions = (
            ca.floor((closest_point.theta[k] - begin) / (end - begin)) if surface.closed[k] else 0.0
        )
        cells.append(
            ca.low(ca.MX(ca.DM(lines)), closest_point.theta[k] - revolutions * (end - begin))
        )
    found = [
        away,
        ca.if_else(closest_point.beyond_end, ON_NO_PIECE, columns * cells[0] + cells[1]),
        along < 0.0,
        ca.if_else(is_normal, sign * along, side * away),
        ca.if_else(is_normal, sign * normal, side * outwards),
    ]
    return ca.Function("foot_of_piece", [point, number], [ca.vertcat(*found)])


def normal_points_outwards(surface: Surface) -> bool:
    """Return whether the normal (4.3) of a surface closed in both directions points outwards.

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


def _edges(surface: Surface) -> list[np.ndarray]:
    """Return lines between pieces, one or more in each cell, on which the normal turns little."""
    grid = sample_grid(surface)
    edges = []
    for axis, theta in enumerate((grid.theta_1, grid.theta_2)):
        turning = float(grid.turning(axis).max())
        count = math.ceil(len(theta) * turning / _TURNING)
        fewest = min(max(count, _FEWEST_PIECES), _MOST_PIECES)
        lines = surface.grid(1, fewest)[axis]
        edges.append(np.append(lines, surface.domain[axis].end) if surface.closed[axis] else lines)
    return edges


def _pieces(surface: Surface, edges: list[np.ndarray]) -> Pieces:
    """Return pieces of a surface between the lines of a grid."""
    fine = [np.sort(np.concatenate([e, 0.5 * (e[1:] + e[:-1])])) for e in edges]
    theta = np.stack(np.meshgrid(*fine, indexing="ij"), axis=-1)
    partials = surface.partials(theta, 3)
    half = [0.5 * np.diff(e) for e in edges]
    a, b = half[0][:, None], half[1][None, :]
    size = np.linalg.norm(partials, axis=-1)

    def largest(*order: int) -> np.ndarray:
        """Return the largest derivative of an order among a piece's samples, [n_1, n_2]."""
        return _over_pieces(size[..., partial_index(*order)])

    # no point is further from a sample than half of the distance between two
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
    """Return the largest value among the samples of each piece, its edges included, [n_1, n_2]."""
    rows = np.max([values[k : len(values) - 2 + k : 2] for k in range(_SAMPLES)], axis=0)
    return np.asarray(
        np.max([rows[:, k : rows.shape[1] - 2 + k : 2] for k in range(_SAMPLES)], axis=0)
    )
