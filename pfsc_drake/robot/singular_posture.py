"""Postures in which a tool cannot move in some direction: which joints bring them about."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from pfsc_drake import jets
from pfsc_drake.robot.robot_model import RobotModel

# of the largest component of a vector, from which on a component counts
_SHARE = 0.3


@dataclass(frozen=True)
class SingularPosture:
    """How close a posture is to a singular one, and through which joints.

    Attributes:
        rcond: Smallest over largest singular value of the tool's Jacobian, lengths in units of
            ``length``, by how much at most one joint alone moves the tool point.
        free: The motion of the joints that moves the tool least, shape (N,), of norm 1.
        cause: By how much each joint changes the smallest singular value, shape (N,).
        jacobian: The Jacobian, shape (6, N), or (3, N) without orientation.
        length: Unit of length [m].
    """

    rcond: float
    free: np.ndarray
    cause: np.ndarray
    jacobian: np.ndarray
    length: float

    @property
    def free_joints(self) -> list[int]:
        """Indices of the joints that can move, together, without moving the tool."""
        return _large(self.free)

    @property
    def causing_joints(self) -> list[int]:
        """Indices of the joints whose coordinates make the posture singular."""
        return _large(self.cause)


def tool_jacobian(robot: RobotModel, q: ca.SX) -> ca.SX:
    """Return the Jacobian of the tool: its rows give velocity and angular velocity.

    Args:
        robot: The robot.
        q: Joint coordinates, shape (N, 1).

    Returns:
        Shape (6, N), world axes [m and rad per rad or m].
    """
    still = [jets.constant(q[i], 1) for i in range(robot.dimension)]
    y, R = (jet.coefficients[0] for jet in robot.tool_pose(still))
    columns = []
    for i in range(robot.dimension):
        # R' = [w x] R
        spin = ca.jacobian(ca.vec(R), q[i]).reshape((3, 3)) @ R.T
        columns.append(ca.vertcat(spin[2, 1], spin[0, 2], spin[1, 0]))
    return ca.densify(ca.vertcat(ca.jacobian(y, q), ca.horzcat(*columns)))


def singular_posture(robot: RobotModel, q: np.ndarray, *, oriented: bool) -> SingularPosture:
    """Return how close a posture is to a singular one, and through which joints.

    With the singular vectors ``u' J v = s`` of the smallest singular value ``s`` of the scaled
    Jacobian J, ``v`` is the motion of the joints that moves the tool least, and
    ``ds/dq_k = u' (dJ/dq_k) v`` tells which joints lead into the singularity and out of it.

    Args:
        robot: A robot with as many joints as the tool has coordinates.
        q: Joint coordinates, shape (N,).
        oriented: Whether the tool's orientation matters.
    """
    symbol, rows = ca.SX.sym("q", robot.dimension), 6 if oriented else 3
    expression = tool_jacobian(robot, symbol)[:rows, :]
    J = np.array(ca.Function("J", [symbol], [expression])(q))
    length = float(np.max(np.linalg.norm(J[:3], axis=0)))
    scale = np.array([1.0 / length] * 3 + [1.0] * (rows - 3))
    u, s, v = np.linalg.svd(scale[:, None] * J)
    least = ca.dot(ca.DM(scale * u[:, -1]), expression @ ca.DM(v[-1]))
    slope = ca.Function("slope", [symbol], [ca.densify(ca.gradient(least, symbol))])
    return SingularPosture(float(s[-1] / s[0]), v[-1], np.array(slope(q)).ravel(), J, length)


def _large(vector: np.ndarray) -> list[int]:
    """Return the indices of the components that count."""
    size = np.abs(vector)
    return np.flatnonzero(size >= _SHARE * np.max(size)).tolist()
