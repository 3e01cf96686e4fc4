"""What the neighbours of scattered points say: spacing, normals, roughness."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

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
