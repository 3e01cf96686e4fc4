"""Orientation of a tool against a reference on jets: three angles, two of its axis, or its yaw."""

import casadi as ca
import numpy as np

from pfsc_drake import jets
from pfsc_drake.geometry import rotation_to_axis
from pfsc_drake.jets import Jet


def orientation_error(R_e: Jet, R_d: Jet, alignment: np.ndarray | None = None) -> list[Jet]:
    """Return the ZYX angles (2.7) of ``R_d' R_e``, each from the ratio of two entries.

    A factor that scales all entries of ``R_d`` alike cancels.

    Where only an axis of the tool matters, ``R_d C`` and ``R_e C`` take the place of ``R_d`` and
    ``R_e``, with the constant rotation C whose first column is the axis in the tool frame. The
    third angle then is a turn about the axis and is left out; the others depend on the first
    column of ``C' R_d' R_e C`` alone, the direction of the axis. Small ones are those by which it
    turns about the third and the second column of ``R_d C``.

    Args:
        R_e: Tool orientation, matrix jet.
        R_d: Reference orientation, matrix jet, times any positive scalar signal.
        alignment: The rotation C, shape (3, 3), or None if all of the orientation matters.

    Returns:
        3 scalar jets [rad], 2 of an axis.
    """
    if alignment is not None:
        R_d, R_e = R_d @ alignment, R_e @ alignment
    x = R_d.T @ R_e[:, 0]
    horizontal = jets.sqrt(x[0] ** 2 + x[1] ** 2)
    direction = [jets.atan2(x[1], x[0]), jets.atan2(-x[2], horizontal)]
    if alignment is not None:
        return direction
    z = R_d[:, 2]
    return [*direction, jets.atan2(jets.dot(z, R_e[:, 1]), jets.dot(z, R_e[:, 2]))]


def yaw_error(R_e: Jet, R_d: Jet, axis: np.ndarray) -> Jet:
    """Return the angle by which ``R_e`` is turned about a fixed axis against ``R_d`` [rad].

    With the quaternion ``(w, v)`` of ``M = R_e R_d'`` and the axis ``a`` it is
    ``2 atan2(a . v, w)``. In right-handed axes ``a, b, c`` it comes from the entries of M:
    ``c' M b - b' M c = 4 w a . v`` and ``b' M b + c' M c = 2 w^2 - 2 (a . v)^2``. Where the tool is
    not tilted against its reference it is the angle of M itself, and its rate the relative angular
    velocity about ``a``; it is defined unless the tilt is half a turn. A factor that scales all
    entries of ``R_d`` alike cancels.

    Args:
        R_e: Tool orientation, matrix jet.
        R_d: Reference orientation, matrix jet, times any positive scalar signal.
        axis: ``a``, world axes, of length one, shape (3,).
    """
    _, b, c = rotation_to_axis(axis).T
    b_e, c_e, b_d, c_d = R_e.T @ b, R_e.T @ c, R_d.T @ b, R_d.T @ c
    sine = jets.dot(c_e, b_d) - jets.dot(b_e, c_d)
    return jets.atan2(sine, jets.dot(b_e, b_d) + jets.dot(c_e, c_d))


def quaternion_rotation(q: Jet) -> Jet:
    """Return ``|q|^2 R(q)`` of a quaternion signal (w, x, y, z)."""
    w, x, y, z = (q[i] for i in range(4))
    ww, xx, yy, zz = w**2, x**2, y**2, z**2
    xy, xz, yz, wx, wy, wz = x * y, x * z, y * z, w * x, w * y, w * z
    rows = [
        [ww + xx - yy - zz, (xy - wz) * 2.0, (xz + wy) * 2.0],
        [(xy + wz) * 2.0, ww - xx + yy - zz, (yz - wx) * 2.0],
        [(xz - wy) * 2.0, (yz + wx) * 2.0, ww - xx - yy + zz],
    ]
    return Jet(
        [
            ca.vertcat(*[ca.horzcat(*[entry.coefficients[k] for entry in row]) for row in rows])
            for k in range(q.order + 1)
        ]
    )
