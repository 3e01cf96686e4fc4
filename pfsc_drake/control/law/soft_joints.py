"""Errors of laws of stiff joints on elastic joints, near rest.

Joints of stiffness ``K_s`` carry the links by ``tau_J = K_s (q_M - q_J) = D_E q_J''``, and motors
obey ``D_M q_M'' = tau_d - tau_J``; weight is constant near rest, and speeds are small. The tool's
coordinates move with ``J q_J``.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.singular_posture import task_jacobian

_FREQUENCIES = 300


@dataclass(frozen=True)
class SoftJoints:
    """Elastic joints near a posture.

    Attributes:
        D_E: Mass matrix of the links [kg m^2 or kg], shape (N, N).
        D_M: Rotor inertias on the joint side, shape (N,).
        K_s: Stiffnesses [Nm/rad or N/m], shape (N,).
        J: Jacobian of the tool, shape (m, N), m <= N, see :func:`task_jacobian`.
    """

    D_E: np.ndarray
    D_M: np.ndarray
    K_s: np.ndarray
    J: np.ndarray


def soft_joints(
    robot: RobotModel,
    q_J: np.ndarray,
    *,
    oriented: bool,
    tool_axis: np.ndarray | None = None,
    yaw_axis: np.ndarray | None = None,
) -> SoftJoints:
    """Return the elastic joints of a robot near a posture.

    Args:
        robot: A robot with elastic joints, as many as outputs or more.
        q_J: Joint coordinates, shape (N,).
        oriented: Whether the tool's orientation matters.
        tool_axis: Axis in the tool frame about which it may rotate, shape (3,), or None.
        yaw_axis: Only axis in the world about which its rotation matters, shape (3,), or None.
    """
    q = ca.SX.sym("q", robot.dimension)
    J_q = task_jacobian(robot, q, oriented=oriented, tool_axis=tool_axis, yaw_axis=yaw_axis)
    expressions = [robot.mass_matrix(q), J_q]
    D_E, J = (np.array(x) for x in ca.Function("soft", [q], expressions)(q_J))
    return SoftJoints(D_E, robot.D_M, robot.K_s, J)


def bending(joints: SoftJoints) -> float:
    """Return the bending of the joints under slow acceleration of the tool point [s^2].

    It is the largest deviation [m] per acceleration [m/s^2] of a law that acts on the motors:
    ``J (q_J - q_M) = -J K_s^-1 D_E J^-1 y''``, independent of its gains.
    """
    compliance = joints.J @ (joints.D_E / joints.K_s[:, None]) @ np.linalg.pinv(joints.J)
    return float(np.linalg.norm(compliance[:3, :3], 2))


def composite_law_error(
    joints: SoftJoints,
    damping: np.ndarray,
    proportional: np.ndarray,
    posture: np.ndarray | None = None,
) -> float:
    """Return the largest error with slow (3.70) plus fast law (3.71) [s^2].

    Under ``tau_d = (D_E + D_M) J^-1 v - epsilon D_b tau_J'`` with
    ``v = y_p'' - a_2 e' - a_1 e`` the joints obey::

        D_M K_s^-1 D_E q'''' + epsilon D_b D_E q''' + (D_E + D_M) q'' = (D_E + D_M) J^-1 v

    so that ``y'' = W(s) v``, and the error ``e = y - y_p`` responds to the desired acceleration by
    ``(s^2 + W (a_2 s + a_1))^-1 (W - 1)``; stiff joints give ``W = 1``. Null-space motion of the
    joints is controlled with gains of its own.

    Args:
        joints: The joints.
        damping: Diagonal of ``epsilon D_b`` [s], shape (N,).
        proportional: ``a_1`` [1/s^2] and ``a_2`` [1/s] of the coordinates, shape (2, m).
        posture: The same for null-space motion of the joints, shape (2, N), with redundant joints.

    Returns:
        Largest deviation of the tool point [m] per harmonic acceleration [m/s^2], over all
        frequencies and directions; infinite if the loop is unstable.
    """
    m, n = joints.J.shape
    J_inverse = np.linalg.pinv(joints.J)
    M = joints.D_E + np.diag(joints.D_M)
    third, fourth = damping[:, None] * joints.D_E, (joints.D_M / joints.K_s)[:, None] * joints.D_E
    a_1, a_2 = (J_inverse @ (a[:, None] * joints.J) for a in proportional)
    if posture is not None:
        beside = np.eye(n) - J_inverse @ joints.J
        a_1, a_2 = a_1 + beside * posture[0], a_2 + beside * posture[1]
    loop = np.eye(4 * n, k=n)
    loop[3 * n :] = -np.linalg.solve(fourth, np.hstack([M @ a_1, M @ a_2, M, third]))
    poles = np.linalg.eigvals(loop)
    if np.max(poles.real) >= 0.0:
        return np.inf
    rates = np.abs(poles)
    errors = []
    for omega in np.geomspace(0.1 * np.min(rates), 10.0 * np.max(rates), _FREQUENCIES):
        s = 1j * omega
        W = joints.J @ np.linalg.solve(M + s * third + s**2 * fourth, M) @ J_inverse
        feedback = s**2 * np.eye(m) + W * (s * proportional[1] + proportional[0])
        error = np.linalg.solve(feedback, W - np.eye(m))
        errors.append(np.linalg.norm(error[:3, :3], 2))
    return float(np.max(errors))
