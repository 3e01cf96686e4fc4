"""External wrench at the tool point to generalized forces along the coordinates of a path."""

import casadi as ca
import numpy as np

from pfsc_drake.control.manifolds.orientation import quaternion_rotation
from pfsc_drake.geometry import PathPointLayout
from pfsc_drake.jets import Jet


def translational_force(force: ca.SX, point: ca.SX, layout: PathPointLayout) -> ca.SX:
    """Return ``(tau_par, tau_perp, tau_cross)`` (3.41).

    ``tau_par = e_par . f / beta`` with ``1 / beta = 1 - alpha`` (3.11), because
    ``eta' = beta e_par . y_t'``; ``tau_perp = e_perp . f`` and
    ``tau_cross = (e_par x e_perp) . f``. They exist wherever the path has a direction;
    beyond an end of the path alpha is zero.

    Args:
        force: Force on the tool at the tool point, world axes [N], shape (3,).
        point: Path point next to the tool, laid out by ``layout``.
        layout: Layout of ``point``.

    Returns:
        Generalized forces [N], shape (3,).
    """
    components = force_components(force, point, layout)
    return ca.vertcat(components[0] * (1.0 - point[layout.alpha]), components[1:])


def force_components(force: ca.SX, point: ca.SX, layout: PathPointLayout) -> ca.SX:
    """Return a force along ``e_par``, ``e_perp`` and ``e_par x e_perp`` [N], shape (3,).

    Args:
        force: World axes [N], shape (3,).
        point: Path point, laid out by ``layout``.
        layout: Layout of ``point``.
    """
    slope, e_perp = point[layout.position][3:6], point[layout.normal]
    e_par = slope / ca.norm_2(slope)
    return ca.vertcat(*[ca.dot(e, force) for e in (e_par, e_perp, ca.cross(e_par, e_perp))])


def rotational_force(
    torque: ca.SX,
    point: ca.SX,
    layout: PathPointLayout,
    phi: ca.SX,
    alignment: np.ndarray | None = None,
) -> ca.SX:
    """Return ``T_ZYX'(phi_pd) mu^d`` (3.44), with ``mu^d = R_d' mu`` (3.45).

    Of an axis, the first two components with ``mu^d = C' R_d' mu``.

    Args:
        torque: Torque on the tool about the tool point, world axes [Nm], shape (3,); where an
            axis alone matters, that of :func:`torque_across_axis`.
        point: Path point of an oriented path next to the tool, laid out by ``layout``.
        layout: Layout of ``point``.
        phi: ``phi_pd``, angles of ``R_d' R_p`` (3.43) [rad], shape (3,), or (2,) of an axis.
        alignment: The rotation C of :func:`orientation_error`, or None.

    Returns:
        Generalized forces along the angles [Nm], shape (3,), or (2,) of an axis.
    """
    quaternion = point[layout.quaternion][:4]
    w, v = quaternion[0], quaternion[1:]
    # R' mu of a quaternion of any norm
    turn = ca.cross(torque, v)
    mu_d = torque + (w * turn + ca.cross(turn, v)) * (2.0 / ca.sumsqr(quaternion))
    if alignment is not None:
        mu_d = alignment.T @ mu_d
    x, y, z = ca.vertsplit(mu_d)
    sin_1, cos_1, sin_2, cos_2 = ca.sin(phi[0]), ca.cos(phi[0]), ca.sin(phi[1]), ca.cos(phi[1])
    if alignment is not None:
        return ca.vertcat(z, cos_1 * y - sin_1 * x)
    about_y = cos_1 * x + sin_1 * y
    return ca.vertcat(z, cos_1 * y - sin_1 * x, cos_2 * about_y - sin_2 * z)


def torque_across_axis(
    torque: ca.SX, point: ca.SX, layout: PathPointLayout, phi: ca.SX, alignment: np.ndarray
) -> ca.SX:
    """Return a torque without its part about the axis of the tool [Nm], shape (3,).

    The two angles of an axis move with the angular velocity across it, whatever the tool's turn
    about it, so that torques about the axis do no work on them: with the map B from the tool's
    twist to the rates of the coordinates, wrenches ``B' tau`` have none, and of any other wrench
    this leaves the part that is one.

    Args:
        torque: Torque on the tool about the tool point, world axes [Nm], shape (3,).
        point: Path point of an oriented path next to the tool, laid out by ``layout``.
        layout: Layout of ``point``.
        phi: The two angles of the axis where the tool is to be [rad], shape (2,).
        alignment: The rotation C of :func:`orientation_error`, shape (3, 3).
    """
    quaternion = point[layout.quaternion][:4]
    R_d = quaternion_rotation(Jet([quaternion])).coefficients[0] / ca.sumsqr(quaternion)
    cos_2 = ca.cos(phi[1])
    direction = ca.vertcat(cos_2 * ca.cos(phi[0]), cos_2 * ca.sin(phi[0]), -ca.sin(phi[1]))
    axis = R_d @ (alignment @ direction)
    return torque - axis * ca.dot(axis, torque)


def turning_force(torque: ca.SX, point: ca.SX, layout: PathPointLayout) -> ca.SX:
    """Return the force that a torque exerts along eta, because ``R_d`` turns with eta [N].

    The tool's angular velocity is ``omega = omega_d + R_d T_ZYX(phi) phi'`` with
    ``omega_d = (omega_d / eta') eta'``: on a path whose orientation turns by
    ``omega_d / eta'`` [rad/m], a torque does work along eta too. (3.41) has no such
    term, because there the rotational coordinates are those of ``omega`` itself.

    Args:
        torque: Torque on the tool about the tool point, world axes [Nm], shape (3,).
        point: Path point of an oriented path next to the tool, laid out by ``layout``.
        layout: Layout of ``point``.
    """
    quaternion, slope = point[layout.quaternion], point[layout.position][3:6]
    w, v, w_1, v_1 = ca.vertsplit(quaternion[:8], [0, 1, 4, 5, 8])
    # vector part of q' q*, twice which is the angular velocity per theta
    rate = w * v_1 - w_1 * v + ca.cross(v, v_1)
    return ca.dot(rate, torque) * (2.0 / ca.sumsqr(quaternion[:4])) / ca.norm_2(slope)
