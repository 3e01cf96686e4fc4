"""Orthonormal frame of a surface."""

import numpy as np


def surface_axes(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return ``[t_1, e_perp x t_1, e_perp]`` as columns, (4.2), (4.3).

    Sigma of (4.15) holds the components of both slopes along the first two.

    Args:
        first: ``sigma_1``, in world axes, [3].
        second: ``sigma_2``, [3].

    Returns:
        Rotation matrix [3, 3]; not finite where the surface is not regular.
    """
    cross = np.cross(first, second)
    with np.errstate(invalid="ignore", divide="ignore"):
        t_1, normal = first / np.linalg.norm(first), cross / np.linalg.norm(cross)
    return np.column_stack([t_1, np.cross(normal, t_1), normal])
