"""External wrench at the tool point to generalized forces along the virtual output."""

import math

import numpy as np

from pfsc_drake.geometry import PathPointLayout


def euler_rate_matrix(phi: np.ndarray) -> np.ndarray:
    """Return ``T_ZYX(phi)`` (2.21): ``omega = T_ZYX phi'`` in the axes that phi starts from.

    Args:
        phi: ZYX angles [rad], shape (3,).

    Returns:
        Matrix of determinant ``-cos(phi_2)``, shape (3, 3).
    """
    sin_1, cos_1 = math.sin(phi[0]), math.cos(phi[0])
    sin_2, cos_2 = math.sin(phi[1]), math.cos(phi[1])
    return np.array(
        [
            [0.0, -sin_1, cos_1 * cos_2],
            [0.0, cos_1, sin_1 * cos_2],
            [1.0, 0.0, -sin_2],
        ]
    )


def translational_force(
    force: np.ndarray, point: np.ndarray, layout: PathPointLayout
) -> np.ndarray:
    """Return ``(tau_par, tau_perp, tau_cross)`` (3.41).

    ``tau_par = e_par . f / beta`` with ``1 / beta = 1 - alpha`` (3.11), because
    ``eta' = beta e_par . y_t'``; ``tau_perp = e_perp . f`` and
    ``tau_cross = (e_par x e_perp) . f``. Nothing is divided by, so that they exist
    everywhere; beyond an end of the path alpha is zero.

    Args:
        force: Force on the tool at the tool point, world axes [N], shape (3,).
        point: Path point next to the tool, laid out by ``layout``.
        layout: Layout of ``point``.

    Returns:
        Generalized forces [N], shape (3,).
    """
    x, y, z = point[layout.position][3:6].tolist()
    u, v, w = point[layout.normal].tolist()
    f, g, h = force.tolist()
    norm = math.sqrt(x * x + y * y + z * z)
    x, y, z = x / norm, y / norm, z / norm
    along = (x * f + y * g + z * h) * (1.0 - float(point[layout.alpha][0]))
    across = (y * w - z * v) * f + (z * u - x * w) * g + (x * v - y * u) * h
    return np.array([along, u * f + v * g + w * h, across])


def rotational_force(
    torque: np.ndarray, point: np.ndarray, layout: PathPointLayout, phi: np.ndarray
) -> np.ndarray:
    """Return ``T_ZYX'(phi_pd) mu^d`` (3.44), with ``mu^d = R_d' mu`` (3.45).

    Args:
        torque: Torque on the tool about the tool point, world axes [Nm], shape (3,).
        point: Path point of an oriented path next to the tool, laid out by ``layout``.
        layout: Layout of ``point``.
        phi: ``phi_pd``, ZYX angles of ``R_d' R_p`` (3.43) [rad], shape (3,).

    Returns:
        Generalized forces along the three angles [Nm], shape (3,).
    """
    w, a, b, c = point[layout.quaternion][:4].tolist()
    x, y, z = torque.tolist()
    # R' mu of a quaternion of any norm
    tx, ty, tz = b * z - c * y, c * x - a * z, a * y - b * x
    scale = 2.0 / (w * w + a * a + b * b + c * c)
    x += (b * tz - c * ty - w * tx) * scale
    y += (c * tx - a * tz - w * ty) * scale
    z += (a * ty - b * tx - w * tz) * scale
    sin_1, cos_1 = math.sin(phi[0]), math.cos(phi[0])
    sin_2, cos_2 = math.sin(phi[1]), math.cos(phi[1])
    about_y = cos_1 * x + sin_1 * y
    return np.array([z, cos_1 * y - sin_1 * x, cos_2 * about_y - sin_2 * z])


def turning_force(torque: np.ndarray, point: np.ndarray, layout: PathPointLayout) -> float:
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
    slope = point[layout.position][3:6]
    quaternion = point[layout.quaternion]
    (w, *v), (w_1, *v_1) = quaternion[:4], quaternion[4:8]
    # vector part of q' q*, twice which is the angular velocity per theta
    rate = w * np.array(v_1) - w_1 * np.array(v) + _cross(v, v_1)
    per_theta = rate * (2.0 / (w * w + np.dot(v, v)))
    return float(per_theta @ torque) / math.sqrt(slope @ slope)


def manifold_force(
    wrench: np.ndarray,
    point: np.ndarray,
    layout: PathPointLayout,
    phi: np.ndarray | None = None,
    *,
    with_turning: bool = False,
) -> np.ndarray:
    """Return the generalized forces along ``yhat = (eta, xi_1, xi_2[, phi])``.

    They are (3.41) for the translational coordinates, (3.44) and (3.45) for the
    angles. Their power ``tau . yhat'`` is ``f . y_t' + mu . (omega - omega_d)``: the
    power of the wrench, the rotation being that relative to the path's orientation.
    With ``with_turning`` :func:`turning_force` is added to the tangential one; the
    power is then ``f . y_t' + mu . omega``, and ``A' tau = J_g' wrench`` with
    ``A = d yhat / dq``.

    Args:
        wrench: Force [N] and torque [Nm] on the tool at the tool point, world axes,
            shape (6,).
        point: Path point next to the tool, laid out by ``layout``.
        layout: Layout of ``point``; an oriented one has the rotational forces too.
        phi: ``phi_pd`` [rad], shape (3,); oriented paths only.
        with_turning: Whether torques act along eta where the orientation turns.

    Returns:
        ``(tau_par, tau_perp, tau_cross[, tau_phi])``, shape (3,) [N] or (6,) [N, Nm].
        Values that are not finite come out as they went in.
    """
    force, torque = wrench[:3], wrench[3:]
    translational = translational_force(force, point, layout)
    if not layout.oriented or phi is None:
        return translational
    if with_turning:
        translational[0] += turning_force(torque, point, layout)
    return np.concatenate([translational, rotational_force(torque, point, layout, phi)])


def _cross(a: np.ndarray | list[float], b: np.ndarray | list[float]) -> np.ndarray:
    """Return ``a x b``; ten times faster than numpy's for single vectors."""
    return np.array(
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    )
