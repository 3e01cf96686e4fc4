"""What scattered points leave uncovered, and which of them are neighbours."""

import math
from typing import NamedTuple

import numpy as np
from scipy.spatial import Delaunay, cKDTree

from pfsc_drake.geometry.surfaces.surface import Interval

# Neighbours that a normal is taken from; more while they lie in no plane for noise.
_FEWEST, _MOST = 16, 256
# Thickness of a neighbourhood over its width that passes as a plane.
_FLAT = 0.2
# The neighbour at whose distance one point stands per square of that size.
_FOURTH = 4


class Neighbourhoods(NamedTuple):
    """Properties of scattered points near a surface.

    Attributes:
        spacing: Distance at which points stand, half of them at least so near, m.
        normals: Unit normals of unknown sign, [n, 3].
        thickness: Root mean square distance of points from the plane of their neighbours,
            half of them at most so far, m.
    """

    spacing: float
    normals: np.ndarray
    thickness: float


def neighbourhoods(points: np.ndarray) -> Neighbourhoods:
    """Look at the neighbours of each of more than 16 different points, [n, 3], m."""
    tree = cKDTree(points)
    count = _FEWEST
    while True:
        distances, indices = tree.query(points, min(count, len(points)))
        near = points[indices]
        near = near - near.mean(axis=1, keepdims=True)
        values, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", near, near) / near.shape[1])
        thickness, width = np.sqrt(np.maximum(np.median(values[:, :2], axis=0), 0.0))
        if thickness <= _FLAT * width or count >= min(_MOST, len(points)):
            break
        count *= 2
    return Neighbourhoods(
        float(np.median(distances[:, _FOURTH])), vectors[:, :, 0], float(thickness)
    )


_CELLS_PER_REACH = 6.0
_MOST_CELLS = 400


class Coverage(NamedTuple):
    """How points cover a rectangle.

    Attributes:
        centres: theta_1 [n_1] and theta_2 [n_2] of cells of the rectangle.
        distances: From the centre of each cell to the nearest point, [n_1, n_2], m.
    """

    centres: tuple[np.ndarray, np.ndarray]
    distances: np.ndarray

    @property
    def hole(self) -> tuple[np.ndarray, float]:
        """Centre [2] and radius, m, of the largest circle without points."""
        row, column = np.unravel_index(int(np.argmax(self.distances)), self.distances.shape)
        centre = np.array([self.centres[0][row], self.centres[1][column]])
        return centre, float(self.distances[row, column])

    def covered(
        self, reach: float, domain: tuple[Interval, Interval], closed: bool
    ) -> tuple[Interval, Interval] | None:
        """The largest rectangle of which no place is further than ``reach`` from a point.

        Args:
            reach: m.
            domain: The whole rectangle.
            closed: Whether theta_1 must keep its whole interval.

        Returns:
            Its sides, or None if there is none.
        """
        inside = self.distances <= reach
        if closed:
            inside = np.broadcast_to(np.all(inside, axis=0), inside.shape)
        rows, columns = _largest_rectangle(inside)
        if rows[0] == rows[1]:
            return None
        first, second = (
            Interval(*(side.begin + side.length * np.array(part) / count).tolist())
            for side, part, count in zip(domain, (rows, columns), inside.shape, strict=True)
        )
        return first, second


def cover(
    theta: np.ndarray, domain: tuple[Interval, Interval], reach: float, *, closed: bool
) -> Coverage:
    """How points cover a rectangle, seen with cells of a sixth of a reach, at most 400 x 400.

    Args:
        theta: Parameters of points, lengths in m, [n, 2].
        domain: Sides of the rectangle.
        reach: Distance that is of interest, m.
        closed: Whether theta_1 is periodic.
    """
    counts = [
        min(_MOST_CELLS, math.ceil(_CELLS_PER_REACH * side.length / reach)) for side in domain
    ]
    first, second = (
        side.begin + side.length * (np.arange(count) + 0.5) / count
        for side, count in zip(domain, counts, strict=True)
    )
    begins = np.array([side.begin for side in domain])
    points = theta - begins
    if closed:
        points[:, 0] = np.mod(points[:, 0], domain[0].length)
    # A box of length zero is none.
    tree = cKDTree(points, boxsize=[domain[0].length if closed else 0.0, 0.0])
    cells = np.stack(np.meshgrid(first, second, indexing="ij"), axis=-1) - begins
    distances, _ = tree.query(cells)
    return Coverage((first, second), distances)


def stand(theta: np.ndarray) -> float:
    """Distance at which points stand, also those on lines that are further apart than they.

    Args:
        theta: Parameters, lengths in m, [n, 2], not along one line.

    Returns:
        Longest side of the Delaunay triangle that covers a place, median over all places, m;
        1.8 / sqrt(density) for points thrown at random.
    """
    corners = theta[Delaunay(theta).simplices]
    sides = corners - np.roll(corners, 1, axis=1)
    longest = np.linalg.norm(sides, axis=2).max(axis=1)
    areas = np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0])
    order = np.argsort(longest)
    below = np.cumsum(areas[order])
    return float(longest[order][np.searchsorted(below, 0.5 * below[-1])])


def _largest_rectangle(mask: np.ndarray) -> tuple[tuple[int, int], tuple[int, int]]:
    """Rows and columns, each from and to, of the largest rectangle that is all true."""
    best, found = 0, ((0, 0), (0, 0))
    heights = np.zeros(mask.shape[1], dtype=int)
    for row, line in enumerate(mask):
        heights = np.where(line, heights + 1, 0)
        # Columns that wait for a lower one, with where their height begins to hold.
        waiting: list[tuple[int, int]] = []
        for column, height in enumerate([*heights.tolist(), 0]):
            begin = column
            while waiting and waiting[-1][1] >= height:
                begin, high = waiting.pop()
                if high * (column - begin) > best:
                    best = high * (column - begin)
                    found = ((row + 1 - high, row + 1), (begin, column))
            waiting.append((begin, height))
    return found
