"""How a hand wants the tool to be turned over time."""

from typing import Any

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from pfsc_drake.blocks.cases import first_of, where
from pfsc_drake.geometry import zyx_to_matrix
from pfsc_drake.physics.hand_way import Legs

# rad; below, the sine of half an angle is its series
_SMALL = 1e-3


class OrientationTarget:
    """An orientation ``R_d`` that turns from one to the next about a fixed axis, the shorter way.

    It rests in each, as the target of the tool point does.

    Args:
        times: Of the orientations, ascending, shape (k,) [s].
        zyx_deg: Their ZYX angles (2.7), shape (k, 3) [deg].
    """

    def __init__(self, times: np.ndarray, zyx_deg: np.ndarray) -> None:
        self._legs, R = Legs(times), zyx_to_matrix(np.deg2rad(zyx_deg))
        turns = np.zeros((len(R), 3))
        if len(R) > 1:
            turns[:-1] = Rotation.from_matrix(R[1:] @ np.swapaxes(R[:-1], 1, 2)).as_rotvec()
        angles = np.linalg.norm(turns, axis=1)
        axes = turns / np.maximum(angles, np.finfo(float).tiny)[:, None]
        self._table = ca.MX(ca.DM(np.vstack([R.reshape(-1, 9).T, axes.T, angles])))

    def at(self, time: Any) -> tuple[Any, Any]:
        """Return ``R_d``, shape (3, 3), and its angular velocity, world axes, (3,) [rad/s].

        Args:
            time: [s].
        """
        leg, share, rate = self._legs.at(time)
        row = self._table[:, leg]
        R, axis, angle = ca.reshape(row[:9], 3, 3).T, row[9:12], row[12]
        S, turned = ca.skew(axis), share * angle
        turn = ca.DM.eye(3) + ca.sin(turned) * S + 2.0 * ca.sin(turned / 2.0) ** 2 * (S @ S)
        return turn @ R, rate * angle * axis


def rotation_vector(R: Any) -> Any:
    """Return axis times angle, at most pi, of a rotation, shape (3,) [rad].

    By way of the quaternion that loses no digits: that of four with the largest divisor.

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
