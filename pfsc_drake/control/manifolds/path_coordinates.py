"""The path manifold on jets: tool motion to tangential, transversal, rotational coordinates."""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from pfsc_drake import jets
from pfsc_drake.jets import Jet


@dataclass(frozen=True)
class PathGeometry:
    """The path next to the tool, as expressions.

    Attributes:
        eta: Arc length at the projected point [m], scalar.
        normal: First normal vector ``e_perp`` of the parallel transport frame, shape (3, 1).
        position: ``sigma_t`` and its derivatives by theta, orders 0..r+1, each (3, 1).
        quaternion: Quaternion (w, x, y, z) of the reference orientation, of any
            positive norm, and its derivatives by theta, orders 0..r, each (4, 1);
            empty for arms that have no orientation to follow.
    """

    eta: ca.SX
    normal: ca.SX
    position: Sequence[ca.SX]
    quaternion: Sequence[ca.SX]


def path_parameter(y: Jet, path: PathGeometry) -> Jet:
    """Return the jet of ``theta* - theta*(now)`` of the projected point.

    Order by order from ``F(t) = (y_t - sigma)' sigma' = 0`` (3.7): with
    ``theta_k`` set to zero, ``theta_k = [F]_k / (|sigma'|^2 (1 - alpha))``.
    """
    sigma, slope, curvature = path.position[:3]
    gradient = ca.dot(slope, slope) - ca.dot(y.coefficients[0] - sigma, curvature)
    theta = Jet([ca.SX(0)])
    for k in range(1, y.order + 1):
        trial = theta.append(ca.SX(0))
        offset = y - jets.compose(path.position[: k + 1], trial)
        tangent = jets.compose(path.position[1 : k + 2], trial)
        residual = jets.dot(offset, tangent).coefficients[k]
        theta = theta.append(residual / gradient)
    return theta


def path_coordinates(y: Jet, R_e: Jet, path: PathGeometry) -> list[Jet]:
    """Return the virtual output ``yhat = (eta, xi_1, xi_2, phi)`` (3.20) with its derivatives.

    ``eta' = |sigma'| theta'`` (3.13). ``xi`` are the projections of
    ``y_t - sigma`` on the parallel transport frame, whose derivatives are
    ``xi_i' = e_i . y_t'`` (3.16), (3.17); ``e_perp' = -(e_par' . e_perp) e_par``
    (3.4), primes being time derivatives. ``phi`` are the ZYX Euler angles of
    ``R_d' R_e``, see (3.43)-(3.47); that the reference orientation moves with the
    progress on the path sits in their derivatives.

    Args:
        y: Tool point ``y_t`` [m], vector jet of order r >= 1.
        R_e: Tool orientation, matrix jet of order r.
        path: The path at the projection of the tool point.

    Returns:
        3 or 6 scalar jets of order r [m, m, m, rad, rad, rad].
    """
    theta = path_parameter(y, path)
    tangent = jets.compose(path.position[1 : y.order + 1], theta)
    speed = jets.sqrt(jets.dot(tangent, tangent))
    eta = (speed * theta.differentiate()).integrate(path.eta)
    e_par = tangent / speed
    e_perp = _transported(path.normal, e_par)
    offset = y.coefficients[0] - path.position[0]
    velocity = y.differentiate()
    xi = [
        jets.dot(e, velocity).integrate(ca.dot(e.coefficients[0], offset))
        for e in (e_perp, jets.cross(e_par, e_perp))
    ]
    if not path.quaternion:
        return [eta, *xi]
    return [eta, *xi, *orientation_error(R_e, jets.compose(path.quaternion, theta))]


def _transported(normal: ca.SX, e_par: Jet) -> Jet:
    """Return the parallel transport (3.4) of a normal vector along the moving tangent."""
    if e_par.order == 0:
        return Jet([normal])
    turning = e_par.differentiate()
    return jets.solve_ode(lambda e: -(e_par * jets.dot(turning, e)), normal, e_par.order)


def orientation_error(R_e: Jet, q_d: Jet) -> list[Jet]:
    """Return the ZYX angles (2.7) of ``R_d' R_e``, each from the ratio of two entries.

    The norm of the quaternion scales all entries alike and cancels.

    Args:
        R_e: Tool orientation, matrix jet.
        q_d: Quaternion (w, x, y, z) of the reference orientation, of any positive norm.

    Returns:
        3 scalar jets [rad].
    """
    R_d = quaternion_rotation(q_d)
    x, z = R_d.T @ R_e[:, 0], R_d[:, 2]
    horizontal = jets.sqrt(x[0] ** 2 + x[1] ** 2)
    return [
        jets.atan2(x[1], x[0]),
        jets.atan2(-x[2], horizontal),
        jets.atan2(jets.dot(z, R_e[:, 1]), jets.dot(z, R_e[:, 2])),
    ]


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
