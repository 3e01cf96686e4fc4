"""Bodies of workpieces: a cross-section swept along a curve, and a bore of convex wedges."""

import math

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.surfaces.parametric_surface import Surface


def swept_surface(
    curve: Curve, theta: np.ndarray, profile: np.ndarray, up: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the triangles of a cross-section swept along a curve.

    At each parameter the cross-section is normal to the curve, its second axis as near to
    ``up`` as possible, its first one to the left of the motion, ``up x tangent``.

    Args:
        curve: The curve.
        theta: Increasing parameters of the cross-sections, shape (k,), k >= 2.
        profile: Polygon of the cross-section [m], shape (n, 2), n >= 2: left of the curve, and
            above it. Seen along the motion, material is on the right of the directed polygon.
        up: Direction, shape (3,).

    Returns:
        Vertices [m], shape (k n, 3), and triangles, shape (2 (k - 1)(n - 1), 3), whose vertices
        run counter-clockwise seen from outside of the material.

    Raises:
        InputError: If the curve runs along ``up``, or a shape is wrong.
    """
    profile, theta = np.asarray(profile, dtype=float), np.asarray(theta, dtype=float)
    if profile.ndim != 2 or profile.shape[0] < 2 or profile.shape[1] != 2:
        raise InputError(f"profile: shape {profile.shape}; must be (n, 2) with n >= 2")
    if theta.ndim != 1 or len(theta) < 2 or not np.all(np.diff(theta) > 0.0):
        raise InputError(f"theta: {theta.tolist()}; must be two or more increasing numbers")
    motion = curve.derivatives(theta, 1)
    tangent = motion[:, 1] / np.linalg.norm(motion[:, 1], axis=1, keepdims=True)
    left = np.cross(up, tangent)
    length = np.linalg.norm(left, axis=1, keepdims=True)
    if not np.all(length > 1e-6 * np.linalg.norm(up)):
        where = theta[int(np.argmin(length))]
        raise InputError(f"up = {np.asarray(up).tolist()}: the curve runs along it at {where:g}")
    left /= length
    above = np.cross(tangent, left)
    vertices = (
        motion[:, None, 0]
        + profile[None, :, :1] * left[:, None]
        + profile[None, :, 1:] * above[:, None]
    )
    return vertices.reshape(-1, 3), strip(len(theta), len(profile))


def strip(rows: int, columns: int) -> np.ndarray:
    """Return two triangles for every cell of a grid of vertices, clockwise from row to column.

    Args:
        rows: Number of rows of vertices, one after the other.
        columns: Number of vertices in a row.
    """
    cell = np.arange(columns - 1) + columns * np.arange(rows - 1)[:, None]
    here, along = cell.ravel(), cell.ravel() + columns
    return np.concatenate(
        [
            np.column_stack([here, here + 1, along]),
            np.column_stack([here + 1, along + 1, along]),
        ]
    )


# samples per direction of the grid by which lengths are measured
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


FEWEST_WEDGES = 8


def bore_wedges(radius: float, outer_radius: float, depth: float, count: int) -> np.ndarray:
    """Return corners of the convex wedges that surround a bore.

    The bore's axis is z, its mouth is at z = 0, the material is below, z from 0 to ``depth``. The
    inner faces touch the circle of the bore from outside in their middles: the bore is never
    narrower than it, and wider by ``radius (1 / cos(pi / count) - 1)`` at the corners, 0.9 % for
    24 wedges. Contact needs convex bodies, and a plate with holes is not convex.

    Args:
        radius: Radius of the bore [m], positive.
        outer_radius: Outer radius of the ring [m], in the middles of its outer faces; more than
            ``radius``.
        depth: Depth of the bore [m], positive.
        count: Number of wedges, 8 or more.

    Returns:
        [count, 8, 3] m.

    Raises:
        InputError: If a number is out of range.
    """
    if not 0.0 < radius < outer_radius < np.inf:
        raise InputError(f"bore: radius = {radius} m; must be between 0 and {outer_radius} m")
    if not 0.0 < depth < np.inf:
        raise InputError(f"bore: depth = {depth} m; must be a positive number")
    if count < FEWEST_WEDGES:
        raise InputError(f"bore: {count} wedges; must be {FEWEST_WEDGES} or more")
    half = np.pi / count
    angles = 2.0 * half * np.arange(count)[:, np.newaxis] + np.array([-half, half])
    around = np.stack([np.cos(angles), np.sin(angles)], axis=-1) / np.cos(half)
    corners = np.zeros((count, 2, 2, 2, 3))  # wedge, inside or out, side, mouth or bottom
    corners[..., :2] = (
        np.array([radius, outer_radius])[:, np.newaxis, np.newaxis] * around[:, np.newaxis, :, :]
    )[:, :, :, np.newaxis, :]
    corners[:, :, :, 1, 2] = depth
    return corners.reshape(count, 8, 3)
