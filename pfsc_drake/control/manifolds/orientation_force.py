"""Torques on a tool to generalized forces along the angles of its orientation."""

import casadi as ca
import numpy as np

from pfsc_drake.control.manifolds.orientation import quaternion_rotation
from pfsc_drake.jets import Jet


def rotational_force(mu_d: ca.SX, phi: ca.SX, alignment: np.ndarray | None = None) -> ca.SX:
    """Return ``T_ZYX'(phi_pd) mu^d`` (3.44); of an axis, the first two components.

    Args:
        mu_d: Torque on the tool about the tool point ``R_d' mu`` (3.45), in the axes of the
            reference orientation [Nm], shape (3,); where an axis alone matters, that of
            :func:`torque_across_axis`.
        phi: ``phi_pd``, angles of ``R_d' R_p`` (3.43) [rad], shape (3,), or (2,) of an axis.
        alignment: The rotation C of :func:`orientation_error`, or None.

    Returns:
        Generalized forces along the angles [Nm], shape (3,), or (2,) of an axis.
    """
    if alignment is not None:
        mu_d = alignment.T @ mu_d
    x, y, z = ca.vertsplit(mu_d)
    sin_1, cos_1, sin_2, cos_2 = ca.sin(phi[0]), ca.cos(phi[0]), ca.sin(phi[1]), ca.cos(phi[1])
    if alignment is not None:
        return ca.vertcat(z, cos_1 * y - sin_1 * x)
    about_y = cos_1 * x + sin_1 * y
    return ca.vertcat(z, cos_1 * y - sin_1 * x, cos_2 * about_y - sin_2 * z)


def torque_across_axis(torque: ca.SX, R_d: ca.SX, phi: ca.SX, alignment: np.ndarray) -> ca.SX:
    """Return a torque without its part about the axis of the tool [Nm], shape (3,).

    The two angles of an axis move with the angular velocity across it, whatever the tool's turn
    about it, so that torques about the axis do no work on them: with the map B from the tool's
    twist to the rates of the coordinates, wrenches ``B' tau`` have none, and of any other wrench
    this leaves the part that is one.

    Args:
        torque: Torque on the tool about the tool point, world axes [Nm], shape (3,).
        R_d: Reference orientation, shape (3, 3).
        phi: The two angles of the axis where the tool is to be [rad], shape (2,).
        alignment: The rotation C of :func:`orientation_error`, shape (3, 3).
    """
    cos_2 = ca.cos(phi[1])
    direction = ca.vertcat(cos_2 * ca.cos(phi[0]), cos_2 * ca.sin(phi[0]), -ca.sin(phi[1]))
    axis = R_d @ (alignment @ direction)
    return torque - axis * ca.dot(axis, torque)


def quaternion_matrix(quaternion: ca.SX) -> ca.SX:
    """Return the rotation matrix of a quaternion (w, x, y, z) of any positive norm."""
    return quaternion_rotation(Jet([quaternion])).coefficients[0] / ca.sumsqr(quaternion)


def in_axes_of(quaternion: ca.SX, torque: ca.SX) -> ca.SX:
    """Return ``R' mu`` of a quaternion (w, x, y, z) of any positive norm."""
    w, v = quaternion[0], quaternion[1:]
    turn = ca.cross(torque, v)
    return torque + (w * turn + ca.cross(turn, v)) * (2.0 / ca.sumsqr(quaternion))


def turning_torque(torque: ca.SX, quaternion: ca.SX, slope: ca.SX) -> ca.SX:
    """Return the power of a torque per rate of the parameter that an orientation turns with.

    Args:
        torque: World axes [Nm], shape (3,).
        quaternion: (w, x, y, z) of any positive norm.
        slope: Its derivative by the parameter.
    """
    w, v, w_1, v_1 = ca.vertsplit(ca.vertcat(quaternion, slope), [0, 1, 4, 5, 8])
    # vector part of q' q*, twice which is the angular velocity per rate of the parameter
    rate = w * v_1 - w_1 * v + ca.cross(v, v_1)
    return ca.dot(rate, torque) * (2.0 / ca.sumsqr(quaternion))
