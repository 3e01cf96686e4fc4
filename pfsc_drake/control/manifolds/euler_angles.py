"""Euler angles of a tool itself against those of its reference, as the analytic Jacobian has them.

``phi = Phi(R_e) - Phi(R_d)`` in place of the angles of ``R_d' R_e``: its rates are
``T^-1(Phi_e) omega_e - T^-1(Phi_d) omega_d`` with T of (2.15), so that the rows of the decoupling
matrix are those of the analytic Jacobian (2.16) where the reference stands still.
"""

import casadi as ca

from pfsc_drake import jets
from pfsc_drake.jets import Jet


def euler_difference(R_e: Jet, R_d: Jet, convention: str) -> list[Jet]:
    """Return the Euler angles of ``R_e`` less those of ``R_d``, between -pi and pi each.

    Each angle is that of a point in a plane, and the difference that between two points, so that
    it does not jump where an angle does. A factor that scales all entries of ``R_d`` alike cancels.
    Not defined where the second angle of either is at an end of its range.

    Args:
        R_e: Tool orientation, matrix jet.
        R_d: Reference orientation, matrix jet, times any positive scalar signal.
        convention: ``zyx`` (2.7) or ``zyz`` (2.6).

    Returns:
        3 scalar jets [rad].
    """
    pairs = zip(_points(R_e, convention), _points(R_d, convention), strict=True)
    return [
        jets.atan2(y_e * x_d - x_e * y_d, x_e * x_d + y_e * y_d) for (y_e, x_e), (y_d, x_d) in pairs
    ]


def euler_torque(torque: ca.SX, R_d: ca.SX, phi: ca.SX, convention: str) -> tuple[ca.SX, ca.SX]:
    """Return what a torque does with the turn of the reference, and along the angles.

    ``omega_e = T(Phi_e) (phi' + Phi_d')`` and ``Phi_d' = T^-1(Phi_d) omega_d``: the power of a
    torque mu is that of ``T'(Phi_e) mu`` along ``phi``, and that of ``T^-T(Phi_d) T'(Phi_e) mu``
    in the turn of the reference.

    Args:
        torque: Torque on the tool about the tool point, world axes [Nm], shape (3,).
        R_d: Reference orientation, shape (3, 3).
        phi: Angles that the tool is to have against the reference [rad], shape (3,).
        convention: ``zyx`` or ``zyz``.

    Returns:
        Torque that turns with the reference, world axes [Nm], shape (3,), and generalized forces
        along the angles [Nm], shape (3,).
    """
    points = _points(Jet([R_d]), convention)
    Phi_d = ca.vertcat(*[ca.atan2(y.coefficients[0], x.coefficients[0]) for y, x in points])
    along = euler_rates(Phi_d + phi, convention).T @ torque
    return ca.solve(euler_rates(Phi_d, convention).T, along), along


def euler_rates(Phi: ca.SX, convention: str) -> ca.SX:
    """Return T of ``omega = T Phi'`` (2.15), world axes, shape (3, 3).

    Args:
        Phi: Euler angles [rad], shape (3,).
        convention: ``zyx`` or ``zyz``.
    """
    sin_1, cos_1, sin_2, cos_2 = ca.sin(Phi[0]), ca.cos(Phi[0]), ca.sin(Phi[1]), ca.cos(Phi[1])
    across, down = (cos_2, -sin_2) if convention == "zyx" else (sin_2, cos_2)
    return ca.vertcat(
        ca.horzcat(0.0, -sin_1, cos_1 * across),
        ca.horzcat(0.0, cos_1, sin_1 * across),
        ca.horzcat(1.0, 0.0, down),
    )


def _points(R: Jet, convention: str) -> list[tuple[Jet, Jet]]:
    """Return (y, x) of a point at each of the angles of a rotation times a positive scalar."""
    if convention == "zyx":
        first = R[1, 0], R[0, 0]
        second, third = (-R[2, 0], _length(*first)), (R[2, 1], R[2, 2])
    else:
        first = R[1, 2], R[0, 2]
        second, third = (_length(*first), R[2, 2]), (R[2, 1], -R[2, 0])
    return [first, second, third]


def _length(y: Jet, x: Jet) -> Jet:
    return jets.sqrt(x**2 + y**2)
