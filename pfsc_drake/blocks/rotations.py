"""Rotations as expressions: rotation vectors, matrices, and generalized moments."""

from typing import Any

import casadi as ca

from pfsc_drake.blocks.cases import first_of, where

# rad; below, the sine of half an angle is its series
_SMALL = 1e-3


def rotation_vector(R: Any) -> Any:
    """Return axis times angle, at most pi, of a rotation, shape (3,) [rad].

    Computed from the quaternion with the largest divisor of four, which loses no digits.

    Args:
        R: Rotation matrix, shape (3, 3).
    """
    x, y, z = R[0, 0], R[1, 1], R[2, 2]
    a, b, c = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    d, e, f = R[0, 1] + R[1, 0], R[0, 2] + R[2, 0], R[1, 2] + R[2, 1]
    q = first_of(
        (ca.fmin(x + y, ca.fmin(y + z, x + z)) >= 0.0, ca.vertcat(1.0 + x + y + z, a, b, c)),
        (ca.fmin(x - y, x - z) >= 0.0, ca.vertcat(a, 1.0 + x - y - z, d, e)),
        (y >= z, ca.vertcat(b, d, 1.0 - x + y - z, f)),
        otherwise=ca.vertcat(c, e, f, 1.0 - x - y + z),
    )
    q = where(q[0] < 0.0, -q, q) / ca.norm_2(q)
    sine = ca.norm_2(q[1:])
    angle = 2.0 * ca.atan2(sine, q[0])
    per_sine = where(sine < _SMALL, 2.0 + sine * sine / 3.0, angle / ca.fmax(sine, _SMALL))
    return per_sine * q[1:]


def rotation_of(vector: Any) -> Any:
    """Return the rotation by a vector, axis times angle, shape (3, 3).

    Args:
        vector: Shape (3,) [rad].
    """
    angle = ca.norm_2(vector)
    half = angle / 2.0
    small = angle < _SMALL
    sine = where(small, 1.0 - angle**2 / 6.0, ca.sin(angle) / ca.fmax(angle, _SMALL))
    root = where(small, 1.0 - half**2 / 6.0, ca.sin(half) / ca.fmax(half, _SMALL / 2.0))
    S = ca.skew(vector)
    return ca.DM.eye(3) + sine * S + root**2 / 2.0 * (S @ S)


def moment_of(vector: Any, force: Any) -> Any:
    """Return the moment that does the work of a force on a rotation vector, shape (3,) [Nm].

    With ``R = exp([phi])`` and the angular velocity w, world axes, ``phi' = J^-1 w``,

        ``J^-1 = 1 - [phi]/2 + c [phi]^2,   c = (1 - (x/2) cot(x/2)) / x^2,   x = |phi|``,

    so that ``Q . phi' = (J^-T Q) . w``. It is finite for turns of less than 2 pi.

    Args:
        vector: phi, shape (3,) [rad].
        force: Q, shape (3,) [Nm].
    """
    angle = ca.norm_2(vector)
    half = ca.fmax(angle, _SMALL) / 2.0
    series = 1.0 / 12.0 + angle**2 / 720.0
    c = where(angle < _SMALL, series, (1.0 - half / ca.tan(half)) / (4.0 * half**2))
    crossed = ca.cross(vector, force)
    return force + crossed / 2.0 + c * ca.cross(vector, crossed)


def nearest_turn(vector: Any, before: Any) -> Any:
    """Return the vector of the same rotation that is nearest to another one, shape (3,) [rad].

    The candidates are the vector itself and its complement, the turn the other way round, so that
    turns continue beyond pi.

    Args:
        vector: Shape (3,), of a length up to pi [rad].
        before: The other one, shape (3,) [rad].
    """
    other = vector * (1.0 - 2.0 * ca.pi / ca.fmax(ca.norm_2(vector), _SMALL))
    nearer = ca.sumsqr(other - before) < ca.sumsqr(vector - before)
    return where(nearer, other, vector)


def matrix_of(rows: Any) -> Any:
    """Return a matrix from its elements by rows, shape (3, 3).

    Args:
        rows: Shape (9,).
    """
    return ca.reshape(rows, 3, 3).T


def rows_of(matrix: Any) -> Any:
    """Return a matrix by rows, shape (9,).

    Args:
        matrix: Shape (3, 3).
    """
    return ca.vec(matrix.T)
