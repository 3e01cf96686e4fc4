"""A round bore as a ring of convex wedges."""

import numpy as np

from pfsc_drake.errors import InputError

FEWEST_WEDGES = 8


def bore_wedges(radius: float, outer_radius: float, depth: float, count: int) -> np.ndarray:
    """Corners of the convex wedges that surround a bore.

    The bore's axis is z, its mouth is at z = 0, the material is below, z from 0 to ``depth``. The
    inner faces touch the circle of the bore from outside in their middles: the bore is never
    narrower than it, and wider by ``radius (1 / cos(pi / count) - 1)`` at the corners, 0.9 % for
    24 wedges. In a ring a pin is held by what is convex, which a plate with holes is not.

    Args:
        radius: Of the bore [m], positive.
        outer_radius: Of the ring [m], in the middles of its outer faces; more than ``radius``.
        depth: Of the bore [m], positive.
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
