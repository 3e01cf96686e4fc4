"""Singular postures, in which a tool cannot move in some direction, and the joints involved."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from pfsc_drake import jets
from pfsc_drake.geometry import rotation_to_axis
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.serial.links import Linkage

# of the largest component of a vector: smallest component that counts
_SHARE = 0.3


@dataclass(frozen=True)
class SingularPosture:
    """Distance of a posture from a singularity, and the joints involved.

    Attributes:
        rcond: Smallest over largest singular value of the tool's Jacobian, lengths in units of
            ``length``, the largest motion of the tool point by a single joint.
        free: The motion of the joints that moves the tool least, shape (N,), of norm 1; on
            redundant robots among motions orthogonal to the null space.
        cause: Derivative of the smallest singular value by each joint, shape (N,).
        jacobian: The Jacobian, shape (m, N), see :func:`task_jacobian`.
        length: Unit of length [m].
    """

    rcond: float
    free: np.ndarray
    cause: np.ndarray
    jacobian: np.ndarray
    length: float

    @property
    def is_redundant(self) -> bool:
        """Whether there are more joints than the tool needs."""
        return self.jacobian.shape[1] > len(self.jacobian)

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


def task_jacobian(
    robot: RobotModel,
    q: ca.SX,
    *,
    oriented: bool,
    tool_axis: np.ndarray | None = None,
    yaw_axis: np.ndarray | None = None,
) -> ca.SX:
    """Return the rows of the tool's Jacobian for the controlled coordinates.

    Args:
        robot: The robot.
        q: Joint coordinates, shape (N, 1).
        oriented: Whether the tool's orientation is controlled.
        tool_axis: Axis in the tool frame about which it may turn, shape (3,), or None.
        yaw_axis: Axis in the world about which alone its turn is controlled, shape (3,), or None.

    Returns:
        Shape (6, N), (3, N) without orientation, or with an axis (5, N): angular velocities
        about two directions across the axis, which turn with the tool; with an axis
        in the world (4, N): the angular velocity about it.
    """
    J = tool_jacobian(robot, q)
    if not oriented:
        return J[:3, :]
    if yaw_axis is not None:
        return ca.densify(ca.vertcat(J[:3, :], ca.DM(yaw_axis).T @ J[3:, :]))
    if tool_axis is None:
        return J
    still = [jets.constant(q[i], 1) for i in range(robot.dimension)]
    R_e = robot.tool_pose(still)[1].coefficients[0]
    across = R_e @ rotation_to_axis(tool_axis)[:, 1:]
    return ca.densify(ca.vertcat(J[:3, :], across.T @ J[3:, :]))


def singular_posture(
    robot: RobotModel,
    q: np.ndarray,
    *,
    oriented: bool,
    tool_axis: np.ndarray | None = None,
    yaw_axis: np.ndarray | None = None,
) -> SingularPosture:
    """Return the distance of a posture from a singularity, and the joints involved.

    With the singular vectors ``u' J v = s`` of the smallest singular value ``s`` of the scaled
    Jacobian J, ``v`` is the motion of the joints that moves the tool least, and
    ``ds/dq_k = u' (dJ/dq_k) v`` identifies joints that move into the singularity and out of it.

    Args:
        robot: A robot with at least as many joints as controlled coordinates, N >= m.
        q: Joint coordinates, shape (N,).
        oriented: Whether the tool's orientation is controlled.
        tool_axis: Axis in the tool frame about which it may turn, shape (3,), or None.
        yaw_axis: Axis in the world about which alone its turn is controlled, shape (3,), or None.
    """
    symbol = ca.SX.sym("q", robot.dimension)
    expression = task_jacobian(
        robot, symbol, oriented=oriented, tool_axis=tool_axis, yaw_axis=yaw_axis
    )
    rows = expression.shape[0]
    J = np.array(ca.Function("J", [symbol], [expression])(q))
    length = float(np.max(np.linalg.norm(J[:3], axis=0)))
    scale = np.array([1.0 / length] * 3 + [1.0] * (rows - 3))
    u, s, v = np.linalg.svd(scale[:, None] * J)
    free = v[rows - 1]
    least = ca.dot(ca.DM(scale * u[:, -1]), expression @ ca.DM(free))
    slope = ca.Function("slope", [symbol], [ca.densify(ca.gradient(least, symbol))])
    return SingularPosture(float(s[-1] / s[0]), free, np.array(slope(q)).ravel(), J, length)


def _large(vector: np.ndarray) -> list[int]:
    """Return the indices of the components that count."""
    size = np.abs(vector)
    return np.flatnonzero(size >= _SHARE * np.max(size)).tolist()


# m, by which axes that meet may miss each other; sine of the angle between parallel axes
_MEET, _PARALLEL = 1e-6, 1e-6
_WRIST = {3, 5}


def joint_axes(chain: Linkage, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the positions and directions of a chain's joint axes.

    Args:
        chain: The chain, N joints.
        q: Joint coordinates, shape (N,).

    Returns:
        A point on each axis [m], shape (N, 3), their directions, shape (N, 3), and the tool
        point [m], shape (3,), all in the world.
    """
    points, directions = [], []
    p, R = np.zeros(3), np.eye(3)
    for link, coordinate in zip(chain.links, q, strict=True):
        p, R = p + R @ link.p_PF, R @ link.R_PF
        points.append(p)
        directions.append(R @ link.axis)
        if link.is_revolute:
            R = R @ Rotation.from_rotvec(coordinate * link.axis).as_matrix()
        else:
            p = p + R @ link.axis * coordinate
    return np.array(points), np.array(directions), p + R @ chain.p_LT


def singularity_name(chain: Linkage, q: np.ndarray, posture: SingularPosture) -> str | None:
    """Return ``wrist``, ``elbow`` or ``shoulder``, or None if these names do not apply.

    They apply to arms whose second and third axes are parallel and perpendicular to the first:
    with three joints, or with six of which the last three axes meet in a point. A wrist
    is singular when axes 4 and 6 are in line, an elbow when it is stretched out or folded
    (joints 2 and 3 can then move, joint 1 cannot), and a shoulder when the centre of the
    wrist, or the tool point, is on axis 1. On redundant robots only the wrist is recognized by the
    joints that can move.

    Args:
        chain: The chain.
        q: Joint coordinates, shape (N,).
        posture: Result of :func:`~pfsc_drake.robot.singular_posture.singular_posture` for them.
    """
    points, directions, _ = joint_axes(chain, q)
    if not all(link.is_revolute for link in chain.links) or len(q) not in (3, 6):
        return None
    first, second, third = directions[:3]
    across = abs(first @ second) < _PARALLEL
    if not across or np.linalg.norm(np.cross(second, third)) > _PARALLEL:
        return None
    free = set(posture.free_joints)
    if len(q) == 6:
        if not _meet(points[3:], directions[3:]):
            return None
        if free <= _WRIST:
            return "wrist"
        if posture.is_redundant:
            return None
    if 0 in free:
        return "shoulder"
    return "elbow" if {1, 2} <= free else None


def _meet(points: np.ndarray, directions: np.ndarray) -> bool:
    """Return whether lines meet in a point."""
    # the point of least distance from all lines; for parallel lines any such point
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    system = across.reshape(-1, 3)
    offsets = np.einsum("kij,kj->ki", across, points).ravel()
    point = np.linalg.lstsq(system, offsets, rcond=None)[0]
    return bool(np.max(np.abs(system @ point - offsets)) < _MEET)
