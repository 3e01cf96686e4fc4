"""What the singular postures of ordinary serial arms are called."""

import numpy as np
from scipy.spatial.transform import Rotation

from pfsc_drake.robot.serial.links import Linkage
from pfsc_drake.robot.singular_posture import SingularPosture

# m, by which axes that meet may miss each other; sine of the angle between parallel axes
_MEET, _PARALLEL = 1e-6, 1e-6
_WRIST = {3, 5}


def joint_axes(chain: Linkage, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return where the joint axes of a chain are.

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
    """Return ``wrist``, ``elbow`` or ``shoulder``, or None where these words do not fit.

    They fit arms with a vertical first axis, as it were, and two parallel ones across it: with
    three joints, or with six of which the last three meet in a point. Of these a wrist
    is singular when axes 4 and 6 are in line, an elbow when it is stretched out or folded
    (joints 2 and 3 can then move, joint 1 cannot), and a shoulder when the centre of the
    wrist, or the tool point, is on axis 1. Where there are more joints than the tool needs, a
    wrist alone is recognized by the joints that can move.

    Args:
        chain: The chain.
        q: Joint coordinates, shape (N,).
        posture: What :func:`~pfsc_drake.robot.singular_posture.singular_posture` makes of them.
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
    # the point of least distance from all lines; of lines that are parallel any will do
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    system = across.reshape(-1, 3)
    offsets = np.einsum("kij,kj->ki", across, points).ravel()
    point = np.linalg.lstsq(system, offsets, rcond=None)[0]
    return bool(np.max(np.abs(system @ point - offsets)) < _MEET)
