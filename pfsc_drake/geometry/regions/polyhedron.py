"""Obstacles bounded by planes."""

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull, QhullError

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.regions.placement import Triple
from pfsc_drake.geometry.regions.region import Distance, Region
from pfsc_drake.geometry.surfaces.placement import checked_placement

# Planes whose coefficients differ by less are one, m.
_SAME = 1e-9
_ROUNDING = 1e-12


class PolyhedronRegion(Region):
    """What lies outside a convex polyhedron.

    The largest of the distances from its planes is the distance where the foot is on a face;
    beside edges and corners it would be too small. A convex polyhedron whose inside is admissible
    is as many half-spaces.

    Args:
        corners: [n, 3], m; points within their hull do not matter.

    Raises:
        InputError: Corners that are no numbers, or lie in a plane.
    """

    def __init__(self, corners: ArrayLike) -> None:
        points = np.asarray(corners, dtype=float)
        if points.ndim != 2 or points.shape[1:] != (3,) or not np.all(np.isfinite(points)):
            raise InputError(
                f"region corners: shape {points.shape}; [n, 3] finite numbers, in m, are required"
            )
        try:
            hull = ConvexHull(points)
        except (QhullError, ValueError):
            raise InputError(
                f"region corners: {len(points)} points that span no volume; four or more that are"
                " not in a plane are required"
            ) from None
        planes: list[np.ndarray] = []
        number = []
        for equation in hull.equations:
            same = [k for k, p in enumerate(planes) if np.abs(p - equation).max() < _SAME]
            number.append(same[0] if same else len(planes))
            if not same:
                planes.append(equation)
        self._planes = [(float(a), float(b), float(c), float(d)) for a, b, c, d in planes]
        edges = {
            tuple(sorted(set(simplex.tolist()) - {int(simplex[k])}))
            for face, simplex in enumerate(hull.simplices)
            for k, beside in enumerate(hull.neighbors[face])
            if number[face] != number[beside]
        }
        self._edges = [_edge(points[a], points[b]) for a, b in sorted(edges)]

    def distance(self, x: float, y: float, z: float) -> Distance:
        """See the base class."""
        h, n_x, n_y, n_z = max(
            [(a * x + b * y + c * z + d, a, b, c) for a, b, c, d in self._planes]
        )
        if h <= 0.0:
            return h, n_x, n_y, n_z
        u, v, w = x - h * n_x, y - h * n_y, z - h * n_z
        for a, b, c, d in self._planes:
            if a * u + b * v + c * w + d > _ROUNDING:
                return self._from_edges(x, y, z)
        return h, n_x, n_y, n_z

    def _from_edges(self, x: float, y: float, z: float) -> Distance:
        """Distance of a point outside whose foot is on an edge or a corner."""
        least, best = math.inf, (0.0, 0.0, 0.0)
        for (a, b, c), (t_x, t_y, t_z), length in self._edges:
            a, b, c = x - a, y - b, z - c
            along = min(max(a * t_x + b * t_y + c * t_z, 0.0), length)
            a, b, c = a - along * t_x, b - along * t_y, c - along * t_z
            square = a * a + b * b + c * c
            if square < least:
                least, best = square, (a, b, c)
        h = math.sqrt(least)
        return h, best[0] / h, best[1] / h, best[2] / h


def box_corners(size: ArrayLike, centre: ArrayLike, rotation: ArrayLike | None) -> np.ndarray:
    """Corners of a box, [8, 3], m.

    Args:
        size: Along its axes, [3], m, positive.
        centre: [3], m.
        rotation: Its axes by columns, [3, 3].

    Raises:
        InputError: A size or placement that is none.
    """
    lengths = np.asarray(size, dtype=float)
    if lengths.shape != (3,) or not np.all((lengths > 0.0) & (lengths < math.inf)):
        raise InputError(f"box size: {lengths.tolist()} m; 3 positive numbers are required")
    o, R = checked_placement(centre, rotation)
    signs = np.stack(np.meshgrid(*3 * [[-0.5, 0.5]]), axis=-1).reshape(-1, 3)
    return np.asarray(o + (signs * lengths) @ R.T)


def _edge(begin: np.ndarray, end: np.ndarray) -> tuple[Triple, Triple, float]:
    """Begin, direction and length of an edge."""
    length = float(np.linalg.norm(end - begin))
    a, b, c = begin.tolist()
    u, v, w = ((end - begin) / length).tolist()
    return (a, b, c), (u, v, w), length
