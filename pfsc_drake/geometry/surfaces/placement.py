"""Where a surface stands in the world."""

import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.rotation import check_rotation_matrix

# Between two axes, as the sine of the angle.
_LEAST_ANGLE = 1e-3


def checked_placement(
    origin: ArrayLike, rotation: ArrayLike | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return origin [3], m, and rotation [3, 3] of a surface as arrays, the identity by default.

    Raises:
        InputError: Not three finite numbers, or not a rotation.
    """
    o = np.asarray(origin, dtype=float)
    if o.shape != (3,) or not np.all(np.isfinite(o)):
        raise InputError(f"surface origin: {o.tolist()}; 3 finite numbers, in m, are required")
    if rotation is None:
        return o, np.eye(3)
    R = check_rotation_matrix(rotation, "surface rotation")
    if R.shape != (3, 3):
        raise InputError(f"surface rotation: shape {R.shape}; (3, 3) is required")
    return o, R


def rotation_from_axes(axis: ArrayLike, start: ArrayLike | None = None) -> np.ndarray:
    """Rotation whose z-axis is a given one, and its x-axis as near as can be to another.

    Args:
        axis: Direction of the z-axis, of any length, [3].
        start: Direction that the x-axis leans to, [3]; by default that of the world's x-axis, or of
            its y-axis where z is along x.

    Returns:
        Rotation matrix [3, 3].

    Raises:
        InputError: A direction that is none, or both along one line.
    """
    z = _direction("axis", axis)
    if start is None:
        upright = np.hypot(z[1], z[2]) <= _LEAST_ANGLE
        start = (0.0, 1.0, 0.0) if upright else (1.0, 0.0, 0.0)
    y = np.cross(z, _direction("start", start))
    if not np.linalg.norm(y) > _LEAST_ANGLE:
        raise InputError(
            f"start: {np.asarray(start).tolist()}; a direction that is not along"
            f" axis = {np.asarray(axis).tolist()} is required"
        )
    y /= np.linalg.norm(y)
    return np.column_stack([np.cross(y, z), y, z])


def _direction(name: str, vector: ArrayLike) -> np.ndarray:
    v = np.asarray(vector, dtype=float)
    if v.shape != (3,) or not np.all(np.isfinite(v)) or not np.any(v):
        raise InputError(f"{name}: {v.tolist()}; 3 finite numbers, not all zero, are required")
    v = v / np.abs(v).max()  # squares of huge or tiny numbers are none
    return np.asarray(v / np.linalg.norm(v))
