"""Triangles of a surface."""

import math

import numpy as np

from pfsc_drake.geometry.surfaces.surface import Surface
from pfsc_drake.geometry.sweep import strip

# of the grid on which lengths are looked for
_FIRST = 33


def surface_mesh(surface: Surface, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices on a surface and the triangles between them.

    Args:
        surface: The surface.
        spacing: Largest distance between neighbours along a parameter, roughly [m].

    Returns:
        Vertices [m], shape (k, 3), and triangles, shape (n, 3), whose vertices run
        counter-clockwise seen from where the normal points to. Closed directions have a seam.
    """
    rough = _grid(surface, (_FIRST, _FIRST))
    counts = []
    for axis in (0, 1):
        steps = np.linalg.norm(np.diff(rough, axis=axis), axis=-1)
        counts.append(1 + max(1, math.ceil(steps.sum(axis=axis).max() / spacing)))
    vertices = _grid(surface, (counts[0], counts[1])).reshape(-1, 3)
    return vertices, strip(*counts)[:, ::-1]


def _grid(surface: Surface, counts: tuple[int, int]) -> np.ndarray:
    """Return points of a surface [m], shape (*counts, 3)."""
    first, second = (
        np.linspace(*ends, count) for ends, count in zip(surface.domain, counts, strict=True)
    )
    theta = np.stack(np.meshgrid(first, second, indexing="ij"), axis=-1)
    return np.asarray(surface.partials(theta, 0)[..., 0, :])
