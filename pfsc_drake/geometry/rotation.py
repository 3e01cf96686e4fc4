"""Rotation matrices, quaternions (w, x, y, z) and Euler angles.

All functions work along leading axes: matrices [..., 3, 3], quaternions [..., 4],
angles [..., 3] in rad.
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from pfsc_drake.errors import InputError

_ORTHONORMAL = 1e-6


def zyx_to_matrix(angles: ArrayLike) -> np.ndarray:
    """Return R = R_z(angle_1) R_y(angle_2) R_x(angle_3), equation (2.7).

    Args:
        angles: [..., 3], rad.

    Returns:
        Rotation matrices [..., 3, 3].
    """
    return _euler_to_matrix("ZYX", angles)


def zyz_to_matrix(angles: ArrayLike) -> np.ndarray:
    """Return R = R_z(angle_1) R_y(angle_2) R_z(angle_3), equation (2.6).

    Args:
        angles: [..., 3], rad.

    Returns:
        Rotation matrices [..., 3, 3].
    """
    return _euler_to_matrix("ZYZ", angles)


def matrix_to_zyx(matrix: ArrayLike) -> np.ndarray:
    """Return the ZYX angles of rotation matrices, inverse of (2.7).

    Args:
        matrix: [..., 3, 3].

    Returns:
        Angles [..., 3], rad, the second in [-pi/2, pi/2]. At its ends only the sum or
        difference of the other two is defined; the third is then zero.
    """
    R = np.asarray(matrix, dtype=float)
    cos_2 = np.hypot(R[..., 0, 0], R[..., 1, 0])
    singular = cos_2 < 1e-12
    first = np.where(
        singular,
        np.arctan2(-R[..., 0, 1], R[..., 1, 1]),
        np.arctan2(R[..., 1, 0], R[..., 0, 0]),
    )
    third = np.where(singular, 0.0, np.arctan2(R[..., 2, 1], R[..., 2, 2]))
    return np.stack([first, np.arctan2(-R[..., 2, 0], cos_2), third], axis=-1)


def matrix_to_zyz(matrix: ArrayLike) -> np.ndarray:
    """Return the ZYZ angles of rotation matrices, inverse of (2.6).

    Args:
        matrix: [..., 3, 3].

    Returns:
        Angles [..., 3], rad, the second in [0, pi]. At its ends only the sum or
        difference of the other two is defined; the third is then zero.
    """
    R = np.asarray(matrix, dtype=float)
    sin_2 = np.hypot(R[..., 0, 2], R[..., 1, 2])
    singular = sin_2 < 1e-12
    # R_z(a) R_y(0 or pi): the second column is [-sin(a), cos(a), 0] in both cases.
    first = np.where(
        singular,
        np.arctan2(-R[..., 0, 1], R[..., 1, 1]),
        np.arctan2(R[..., 1, 2], R[..., 0, 2]),
    )
    third = np.where(singular, 0.0, np.arctan2(R[..., 2, 1], -R[..., 2, 0]))
    return np.stack([first, np.arctan2(sin_2, R[..., 2, 2]), third], axis=-1)


def euler_margin(matrix: ArrayLike, convention: str) -> np.ndarray:
    """Return the distance of the second Euler angle from the singularity of the other two.

    Args:
        matrix: Rotation matrices, [..., 3, 3].
        convention: ``zyx``, singular at -pi/2 and pi/2, or ``zyz``, at 0 and pi.

    Returns:
        rad, [...], 0 to pi/2.
    """
    if convention == "zyx":
        return np.pi / 2.0 - np.abs(matrix_to_zyx(matrix)[..., 1])
    return np.pi / 2.0 - np.abs(matrix_to_zyz(matrix)[..., 1] - np.pi / 2.0)


def rotation_vector_to_quaternion(vector: ArrayLike) -> np.ndarray:
    """Return the quaternion (w, x, y, z) of a rotation vector, the axis times the angle.

    Args:
        vector: [..., 3], rad.

    Returns:
        [..., 4].
    """
    v = np.asarray(vector, dtype=float)
    half = np.linalg.norm(v, axis=-1, keepdims=True) / 2.0
    return np.concatenate([np.cos(half), np.sinc(half / np.pi) * v / 2.0], axis=-1)


def matrix_to_quaternion(matrix: ArrayLike) -> np.ndarray:
    """Return the unit quaternions of rotation matrices.

    Args:
        matrix: [..., 3, 3].

    Returns:
        Quaternions (w, x, y, z), [..., 4], with w >= 0.

    Raises:
        InputError: a matrix is not a rotation.
    """
    R = check_rotation_matrix(matrix)
    q = Rotation.from_matrix(R.reshape(-1, 3, 3)).as_quat().reshape(*R.shape[:-2], 4)
    q = q[..., [3, 0, 1, 2]]
    return np.where(q[..., :1] < 0.0, -q, q)


def quaternion_to_matrix(quaternion: ArrayLike) -> np.ndarray:
    """Return the rotation matrices H(q) / |q|^2 of quaternions of any length but zero.

    Args:
        quaternion: (w, x, y, z), [..., 4].

    Returns:
        Rotation matrices [..., 3, 3].

    Raises:
        InputError: a quaternion is zero or not finite.
    """
    q = np.asarray(quaternion, dtype=float)
    if q.shape[-1:] != (4,):
        raise InputError(f"quaternion: shape {q.shape}; [..., 4] is required")
    square = np.einsum("...i,...i->...", q, q)
    bad = ~((square > 0.0) & np.isfinite(square))
    if np.any(bad):
        value = q[bad].reshape(-1, 4)[0].tolist() if q.ndim > 1 else q.tolist()
        raise InputError(f"quaternion: {value}; finite values, not all zero, are required")
    w, x, y, z = np.moveaxis(q, -1, 0)
    rows = [
        [w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]
    stacked = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
    return stacked / square[..., None, None]


def zyx_to_quaternion(angles: ArrayLike) -> np.ndarray:
    """Return the unit quaternions [..., 4] of ZYX angles [..., 3], rad, see `zyx_to_matrix`."""
    return matrix_to_quaternion(zyx_to_matrix(angles))


def zyz_to_quaternion(angles: ArrayLike) -> np.ndarray:
    """Return the unit quaternions [..., 4] of ZYZ angles [..., 3], rad, see `zyz_to_matrix`."""
    return matrix_to_quaternion(zyz_to_matrix(angles))


# quaternions of Euler angles, by convention
EULER_TO_QUATERNION = {"zyx": zyx_to_quaternion, "zyz": zyz_to_quaternion}


def angle_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return angles between directions, accurate for small ones too.

    Args:
        a: Vectors of any length but zero, [..., 3].
        b: The same.

    Returns:
        [...] rad, 0 to pi.
    """
    dot = np.einsum("...i,...i->...", a, b)
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), dot)


def turn_about(axis: ArrayLike, rotation: ArrayLike, reference: ArrayLike) -> np.ndarray:
    """Return the angle by which rotations are turned about a fixed axis against others.

    ``M = R R_0'`` is split into a rotation without a part about the axis, then a turn by this
    angle about it (swing and twist).

    Args:
        axis: The axis, in the frame that the rotations lead to, of any length but zero, [3].
        rotation: ``R``, [..., 3, 3].
        reference: ``R_0``, [..., 3, 3].

    Returns:
        rad, [...], from -pi to pi; undefined where the rest of M is half a turn.
    """
    _, b, c = rotation_to_axis(axis).T
    M = np.asarray(rotation, dtype=float) @ np.swapaxes(np.asarray(reference, dtype=float), -1, -2)
    M_b, M_c = M @ b, M @ c
    return np.arctan2(M_b @ c - M_c @ b, M_b @ b + M_c @ c)


def rotation_to_axis(axis: ArrayLike) -> np.ndarray:
    """Return the rotation of least angle that turns the x-axis to a direction.

    Of two half turns, about the x-axis and about the middle between it and the direction. To the
    opposite of the x-axis all such rotations are equal; the one about the z-axis is taken.

    Args:
        axis: The direction, of any length but zero, [3].

    Returns:
        Rotation matrix [3, 3]; its first column is the direction, of length one.

    Raises:
        InputError: not three finite numbers, or all zero.
    """
    a = np.asarray(axis, dtype=float)
    if a.shape != (3,) or not np.all(np.isfinite(a)) or not np.any(a):
        raise InputError(f"axis: {a.tolist()}; 3 finite numbers, not all zero, are required")
    a = a / np.abs(a).max()  # squares of huge or tiny numbers overflow or vanish
    a = a / np.linalg.norm(a)
    across = a[1] ** 2 + a[2] ** 2
    # 1 + cos(angle), without cancellation where the angle is obtuse
    middle = np.array([1.0 + a[0] if a[0] >= 0.0 else across / (1.0 - a[0]), a[1], a[2]])
    if not np.any(middle):
        middle[1] = 1.0
    middle = middle / np.abs(middle).max()
    half_turn = 2.0 * np.outer(middle, middle) / (middle @ middle) - np.eye(3)
    return half_turn * [1.0, -1.0, -1.0]


def check_rotation_matrix(matrix: ArrayLike, name: str = "rotation matrix") -> np.ndarray:
    """Return the rotation matrices as an array, if they are orthonormal with determinant +1.

    Args:
        matrix: [..., 3, 3].
        name: Name in error messages.

    Returns:
        The same values, [..., 3, 3].

    Raises:
        InputError: wrong shape, not finite, not orthonormal to 1e-6, or a reflection.
    """
    R = np.asarray(matrix, dtype=float)
    if R.shape[-2:] != (3, 3):
        raise InputError(f"{name}: shape {R.shape}; [..., 3, 3] is required")
    if not np.all(np.isfinite(R)):
        raise InputError(f"{name}: not finite; finite values are required")
    error = np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)).max(initial=0.0)
    if error > _ORTHONORMAL:
        raise InputError(
            f"{name}: R'R differs from the identity by {error:.3g};"
            f" at most {_ORTHONORMAL:g} is allowed"
        )
    determinant = np.linalg.det(R).min(initial=1.0)
    if determinant < 0.0:
        raise InputError(f"{name}: determinant {determinant:.6g}; +1 is required")
    return R


def _euler_to_matrix(sequence: str, angles: ArrayLike) -> np.ndarray:
    values = np.asarray(angles, dtype=float)
    if values.shape[-1:] != (3,):
        raise InputError(f"Euler angles: shape {values.shape}; [..., 3] is required")
    if not np.all(np.isfinite(values)):
        raise InputError("Euler angles: not finite; finite values in rad are required")
    rotation = Rotation.from_euler(sequence, values.reshape(-1, 3))
    return rotation.as_matrix().reshape(*values.shape[:-1], 3, 3)


def placed_points(points: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Return points of a frame C that moves in the world [m], shape (samples, 3).

    Args:
        points: Points in the frame [m], shape (samples, 3).
        frames: ``[p_WC, R_WC by rows, ..]``, shape (samples, 12 or more).
    """
    R_WC = frames[:, 3:12].reshape(-1, 3, 3)
    return np.asarray(frames[:, :3] + np.einsum("kij,kj->ki", R_WC, points))
