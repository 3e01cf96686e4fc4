"""External wrench at the tool point to generalized forces along the coordinates of a path."""

from typing import Any

import casadi as ca

from pfsc_drake.control.manifolds.orientation_force import turning_torque
from pfsc_drake.geometry import PathPointLayout


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
    return path_axes(point, layout).T @ force


def path_axes(point: Any, layout: PathPointLayout) -> Any:
    """Return ``[e_par, e_perp, e_par x e_perp]`` as columns, (3.1)-(3.5), shape (3, 3).

    Args:
        point: Path point, laid out by ``layout``.
        layout: Layout of ``point``.
    """
    slope, e_perp = point[layout.position][3:6], point[layout.normal]
    # a path that stands still has no direction, which is not finite
    e_par = slope / ca.norm_2(slope)
    return ca.horzcat(e_par, e_perp, ca.cross(e_par, e_perp))


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
    return turning_torque(torque, quaternion[:4], quaternion[4:8]) / ca.norm_2(slope)


def frame_turning_force(force: ca.SX, point: ca.SX, layout: PathPointLayout, xi: ca.SX) -> ca.SX:
    """Return the force along eta of a tool beside a path whose frame turns about it [N].

    With ``w = psi' / |sigma'|`` [rad/m], the frame's turn per length of the path, a tool that keeps
    its transversal coordinates moves by ``w (xi_1 e_cross - xi_2 e_perp) eta'`` besides.

    Args:
        force: Force on the tool at the tool point, world axes [N], shape (3,).
        point: Path point of a turning frame next to the tool, laid out by ``layout``.
        layout: Layout of ``point``.
        xi: Transversal coordinates of the tool [m], shape (2,).
    """
    _, perp, cross = ca.vertsplit(force_components(force, point, layout))
    w = point[layout.turn][0] / ca.norm_2(point[layout.position][3:6])
    return w * (xi[0] * cross - xi[1] * perp)
