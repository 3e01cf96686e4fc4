"""Boxes, and other convex polyhedra."""

import dataclasses as dc
import itertools
import math
from collections.abc import Sequence
from functools import reduce
from typing import Annotated

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull, QhullError

from pfsc_drake.checks import FARTHEST, SHORTEST, require
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.regions.region import FormulaRegion, Region, Symbol, Triple, direction
from pfsc_drake.geometry.shapes.plane import plane
from pfsc_drake.geometry.shapes.shape import PlacedShape, ShapeInputs
from pfsc_drake.geometry.surfaces.parametric_surface import Surface, checked_placement
from pfsc_drake.yaml.fields import equal
from pfsc_drake.yaml.rules import Numbers, Range

# Planes whose coefficients differ by less are one, m.
_SAME = 1e-9
_ROUNDING = 1e-12


@dc.dataclass
class Box(PlacedShape):
    """A box, as an obstacle; its origin is its middle.

    Attributes:
        size: Lengths along its three axes [m]; one number for a cube.
    """

    size: Annotated[list[float], Numbers(3, Range(SHORTEST, FARTHEST, "m"))] = dc.field(
        default_factory=lambda: [0.1, 0.1, 0.1], metadata=equal(3)
    )

    def check_side(self, admissible: str) -> None:
        """Refuse an admissible side that its region does not have."""
        allowed = "outside of a !Box; for its inside a !Plane at each of its sides"
        require(admissible in ("", "outside"), "admissible", admissible, allowed)
        super().check_side(admissible)

    def region(self, inputs: ShapeInputs, *, inside: bool) -> Region:
        """Return the region that it bounds."""
        return PolyhedronRegion(box_corners(self.size, self.origin, self.rotation))

    def drawn_surfaces(self, inputs: ShapeInputs) -> Sequence[Surface]:
        """Return its six sides."""
        axes, half = self.rotation, np.array(self.size) / 2.0
        faces = []
        for k, sign in itertools.product(range(3), (-1.0, 1.0)):
            i, j = (k + 1) % 3, (k + 2) % 3
            rotation = np.column_stack([axes[:, i], axes[:, j], axes[:, k]])
            size = ((-half[i], half[i]), (-half[j], half[j]))
            faces.append(plane(size, self.origin + sign * half[k] * axes[:, k], rotation))
        return faces


class PolyhedronRegion(FormulaRegion):
    """Region outside a convex polyhedron.

    Where the closest point is on a face, the largest distance from the planes is the distance;
    beside edges and corners it would be too small. A convex polyhedron whose inside is admissible
    is one half-space for each face.

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
        # among equally near planes the last one counts
        self._planes = sorted((float(a), float(b), float(c), float(d)) for a, b, c, d in planes)
        edges = {
            tuple(sorted(set(simplex.tolist()) - {int(simplex[k])}))
            for face, simplex in enumerate(hull.simplices)
            for k, beside in enumerate(hull.neighbors[face])
            if number[face] != number[beside]
        }
        self._edges = [_edge(points[a], points[b]) for a, b in sorted(edges)]

    def formula(self, point: Symbol) -> tuple[Symbol, Symbol]:
        """Return the signed distance and normal as expressions."""
        heights = [a * point[0] + b * point[1] + c * point[2] + d for a, b, c, d in self._planes]
        h, n = heights[0], ca.SX(self._planes[0][:3])
        for height, face in zip(heights[1:], self._planes[1:], strict=True):
            n = ca.if_else(height >= h, ca.DM(face[:3]), n)
            h = ca.fmax(h, height)
        projection = point - h * n
        over = [
            a * projection[0] + b * projection[1] + c * projection[2] + d
            for a, b, c, d in self._planes
        ]
        on_face = ca.logic_or(h <= 0.0, reduce(ca.fmax, over) <= _ROUNDING)
        away, outwards = direction(self._from_edges(point), (1.0, 0.0, 0.0))
        return ca.if_else(on_face, h, away), ca.if_else(on_face, n, outwards)

    def _from_edges(self, point: Symbol) -> Symbol:
        """Return the vector from the closest point of all edges."""
        least, nearest = ca.SX(math.inf), ca.SX.zeros(3)
        for begin, tangent, length in self._edges:
            offset = point - ca.DM(begin)
            along = ca.fmin(ca.fmax(ca.dot(ca.DM(tangent), offset), 0.0), length)
            offset -= along * ca.DM(tangent)
            square = ca.dot(offset, offset)
            nearest = ca.if_else(square < least, offset, nearest)
            least = ca.fmin(square, least)
        return nearest


def box_corners(size: ArrayLike, centre: ArrayLike, rotation: ArrayLike | None) -> np.ndarray:
    """Return corners of a box, [8, 3], m.

    Args:
        size: Lengths along its axes, [3], m, positive.
        centre: [3], m.
        rotation: Its axes by columns, [3, 3].

    Raises:
        InputError: An invalid size or placement.
    """
    lengths = np.asarray(size, dtype=float)
    if lengths.shape != (3,) or not np.all((lengths > 0.0) & (lengths < math.inf)):
        raise InputError(f"box size: {lengths.tolist()} m; 3 positive numbers are required")
    o, R = checked_placement(centre, rotation)
    signs = np.stack(np.meshgrid(*3 * [[-0.5, 0.5]]), axis=-1).reshape(-1, 3)
    return np.asarray(o + (signs * lengths) @ R.T)


def _edge(begin: np.ndarray, end: np.ndarray) -> tuple[Triple, Triple, float]:
    """Return begin, direction and length of an edge."""
    length = float(np.linalg.norm(end - begin))
    a, b, c = begin.tolist()
    u, v, w = ((end - begin) / length).tolist()
    return (a, b, c), (u, v, w), length
