"""An external wrench at the tool point as generalized forces along a manifold's coordinates."""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.control.manifolds.orientation import quaternion_rotation
from pfsc_drake.geometry import PathPointLayout
from pfsc_drake.geometry.manifold_point import SurfacePointLayout
from pfsc_drake.jets import Jet


def force_along_path(force: ca.SX, point: ca.SX, layout: PathPointLayout) -> ca.SX:
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
    return path_axes(point, layout).T @ force


def path_axes(point: Any, layout: PathPointLayout) -> Any:
    """Return ``[e_par, e_perp, e_par x e_perp]`` as columns, (3.1)-(3.5), shape (3, 3).

    Args:
        point: Path point, laid out by ``layout``.
        layout: Layout of ``point``.
    """
    slope, e_perp = point[layout.position][3:6], point[layout.normal]
    # where the derivative vanishes there is no direction: NaN
    e_par = slope / ca.norm_2(slope)
    return ca.horzcat(e_par, e_perp, ca.cross(e_par, e_perp))


def turning_force(torque: ca.SX, point: ca.SX, layout: PathPointLayout) -> ca.SX:
    """Return the force that a torque exerts along eta, because ``R_d`` turns with eta [N].

    The tool's angular velocity is ``omega = omega_d + R_d T_ZYX(phi) phi'`` with
    ``omega_d = (omega_d / eta') eta'``: on a path whose orientation turns by
    ``omega_d / eta'`` [rad/m], a torque does work along eta too. (3.41) has no such
    term, because there the rotational coordinates belong to ``omega`` itself.

    Args:
        torque: Torque on the tool about the tool point, world axes [Nm], shape (3,).
        point: Path point of an oriented path next to the tool, laid out by ``layout``.
        layout: Layout of ``point``.
    """
    quaternion, slope = point[layout.quaternion], point[layout.position][3:6]
    return turning_torque(torque, quaternion[:4], quaternion[4:8]) / ca.norm_2(slope)


def turning_along_path(force: ca.SX, point: ca.SX, layout: PathPointLayout, xi: ca.SX) -> ca.SX:
    """Return the force along eta of a tool beside a path whose frame turns about it [N].

    With ``w = psi' / |sigma'|`` [rad/m], the frame's turn per length of the path, a tool of
    constant transversal coordinates also moves by ``w (xi_1 e_cross - xi_2 e_perp) eta'``.

    Args:
        force: Force on the tool at the tool point, world axes [N], shape (3,).
        point: Path point of a turning frame next to the tool, laid out by ``layout``.
        layout: Layout of ``point``.
        xi: Transversal coordinates of the tool [m], shape (2,).
    """
    _, perp, cross = ca.vertsplit(force_components(force, point, layout))
    w = point[layout.turn][0] / ca.norm_2(point[layout.position][3:6])
    return w * (xi[0] * cross - xi[1] * perp)


@dataclass(frozen=True)
class TangentPlane:
    """Axes, measures and curvatures of a surface at a point.

    Attributes:
        axes: ``[t_1, t_2, e_perp]`` with ``t_2 = e_perp x t_1``, shape (3, 3).
        Sigma: ``Sigma`` of (4.15), components of ``sigma_1`` and ``sigma_2`` along ``t_1`` and
            ``t_2``, shape (2, 2).
        curvature: Second fundamental form (4.8) along ``t_1`` and ``t_2`` [1/m], shape (2, 2).
        turning: ``t_2 . dt_1`` per length along ``t_1`` and ``t_2`` [rad/m], shape (2,).
    """

    axes: ca.SX
    Sigma: ca.SX
    curvature: ca.SX
    turning: ca.SX


def tangent_plane(point: ca.SX, layout: SurfacePointLayout) -> TangentPlane:
    """Return the tangent plane of a surface point.

    Args:
        point: Surface point.
        layout: Layout of ``point``.
    """
    _, s_1, s_2, s_11, s_12, s_22 = ca.vertsplit(point[layout.position][:18], 3)
    speed, axes = ca.norm_2(s_1), surface_axes(point, layout)
    t_1, t_2, normal = ca.horzsplit(axes)
    Sigma = ca.vertcat(ca.horzcat(speed, ca.dot(t_1, s_2)), ca.horzcat(0.0, ca.dot(t_2, s_2)))
    # parameters per length along t_1 and t_2
    inverse = ca.inv(Sigma)
    second = ca.blockcat([[ca.dot(normal, s_11), ca.dot(normal, s_12)],
                          [ca.dot(normal, s_12), ca.dot(normal, s_22)]])  # fmt: skip
    along = ca.horzcat(ca.dot(t_2, s_11), ca.dot(t_2, s_12)) / speed
    return TangentPlane(axes, Sigma, inverse.T @ second @ inverse, (along @ inverse).T)


def surface_axes(point: Any, layout: SurfacePointLayout) -> Any:
    """Return ``[t_1, t_2, e_perp]`` as columns, (4.2), (4.3), shape (3, 3).

    Args:
        point: Surface point.
        layout: Layout of ``point``.
    """
    s_1, s_2 = ca.vertsplit(point[layout.position][3:9], 3)
    t_1, cross = s_1 / ca.norm_2(s_1), ca.cross(s_1, s_2)
    normal = cross / ca.norm_2(cross)
    return ca.horzcat(t_1, ca.cross(normal, t_1), normal)


def force_along_surface(force: ca.SX, plane: TangentPlane, xi: ca.SX) -> ca.SX:
    """Return ``(tau_par_1, tau_par_2, tau_perp)`` (4.32).

    Because of ``eta' = Sigma H^-1 [sigma_1, sigma_2]' y_t'`` (4.16) and
    ``Sigma' Sigma = [E, F; F, G]`` it is ``tau_par = Sigma^-T H Sigma^-1 [t_1, t_2]' f``, where
    ``Sigma^-T H Sigma^-1`` is one minus xi times the curvature along ``t_1`` and ``t_2``, as
    ``1 - alpha`` of a path; ``tau_perp = e_perp . f``.

    Args:
        force: Force on the tool at the tool point, world axes [N], shape (3,).
        plane: The surface next to the tool.
        xi: Distance of the tool along the normal [m].
    """
    components = plane.axes.T @ force
    along = components[:2]
    return ca.vertcat(along - xi * (plane.curvature @ along), components[2])


def turning_along_surface(torque: ca.SX, plane: TangentPlane) -> ca.SX:
    """Return the forces of a torque along ``eta``, where the surface's frame is the reference [N].

    Per length along ``t_j`` the frame turns by
    ``L_2j t_1 - L_1j t_2 + g_j e_perp``, L being the curvature and g the turning of the plane.

    Args:
        torque: Torque on the tool about the tool point, world axes [Nm], shape (3,).
        plane: The surface next to the tool.
    """
    about = plane.axes.T @ torque
    return plane.curvature @ ca.vertcat(-about[1], about[0]) + plane.turning * about[2]


def quaternion_turning_force(torque: ca.SX, plane: TangentPlane, quaternion: ca.SX) -> ca.SX:
    """Return the forces of a torque along ``eta``, where a quaternion is the reference [N].

    Args:
        torque: Torque on the tool about the tool point, world axes [Nm], shape (3,).
        plane: The surface next to the tool.
        quaternion: The quaternion and its two first partial derivatives, shape (12 or more,).
    """
    q, q_1, q_2 = ca.vertsplit(quaternion[:12], 4)
    powers = ca.vertcat(turning_torque(torque, q, q_1), turning_torque(torque, q, q_2))
    return ca.solve(plane.Sigma.T, powers)


def rotational_force(mu_d: ca.SX, phi: ca.SX, alignment: np.ndarray | None = None) -> ca.SX:
    """Return ``T_ZYX'(phi_pd) mu^d`` (3.44); of an axis, the first two components.

    Args:
        mu_d: Torque on the tool about the tool point ``R_d' mu`` (3.45), in the axes of the
            reference orientation [Nm], shape (3,); if only an axis is controlled, from
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
    twist to the rates of the coordinates, wrenches ``B' tau`` have no such part, and any other
    wrench is projected onto them.

    Args:
        torque: Torque on the tool about the tool point, world axes [Nm], shape (3,).
        R_d: Reference orientation, shape (3, 3).
        phi: The two desired angles of the axis [rad], shape (2,).
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
