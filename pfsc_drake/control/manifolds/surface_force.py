"""External wrench at the tool point to generalized forces along the coordinates of a surface."""

from dataclasses import dataclass
from typing import Any

import casadi as ca

from pfsc_drake.control.manifolds.orientation_force import turning_torque
from pfsc_drake.geometry.surfaces.point import SurfacePointLayout


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


def translational_force(force: ca.SX, plane: TangentPlane, xi: ca.SX) -> ca.SX:
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


def frame_turning_force(torque: ca.SX, plane: TangentPlane) -> ca.SX:
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
