"""Swivel angle of an arm: the turn of its elbow about the line from shoulder to wrist."""

from collections.abc import Sequence

import casadi as ca
import numpy as np

from pfsc_drake import jets
from pfsc_drake.jets import Jet
from pfsc_drake.robot.serial.links import Linkage
from pfsc_drake.robot.serial.newton_euler import points_on_links

# of the angle between the arm's line and the reference direction of a swivel angle
_LEAST_SINE = 0.3


def swivel_angle(
    chain: Linkage, q: Sequence[Jet], joints: tuple[int, int, int], upward: np.ndarray
) -> Jet:
    """Return the angle of the elbow about the line from shoulder to wrist.

    It is zero where the elbow is in the half-plane of ``upward``. It is not defined where shoulder
    and wrist lie one above the other, or in line with the elbow.

    Args:
        chain: The arm.
        q: Its joint coordinates, N scalar jets.
        joints: Indices of the joints whose origins are shoulder, elbow and wrist.
        upward: The direction, world axes, shape (3,).

    Returns:
        Scalar jet [rad].
    """
    shoulder, elbow, wrist = _points(chain, q, joints)
    line, arm = wrist - shoulder, elbow - shoulder
    length = jets.sqrt(jets.dot(line, line))
    up = jets.constant(ca.SX(ca.DM(upward)), line.order)
    sideways = jets.cross(line, up)
    # both as long as the line squared times the sine of its angle with ``upward``
    across = jets.dot(arm, sideways) * length
    towards = jets.dot(arm, jets.cross(sideways, line))
    return jets.atan2(across, towards)


def upward_direction(chain: Linkage, q: np.ndarray, joints: tuple[int, int, int]) -> np.ndarray:
    """Return a reference direction for a swivel angle, shape (3,).

    It is opposite to gravity, unless shoulder and wrist lie nearly one above the other, or there
    is no gravity: then it is the axis of the world that is most nearly perpendicular to their line.

    Args:
        chain: The arm.
        q: Joint coordinates, shape (N,).
        joints: Indices of the joints whose origins are shoulder, elbow and wrist.
    """
    still = [jets.constant(ca.SX(value), 1) for value in q]
    shoulder, _, wrist = _points(chain, still, joints)
    line = np.array(ca.evalf((wrist - shoulder).coefficients[0])).ravel()
    line = line / np.linalg.norm(line)
    weight = np.linalg.norm(chain.gravity)
    if weight > 0.0:
        upward = -chain.gravity / weight
        if np.linalg.norm(np.cross(upward, line)) > _LEAST_SINE:
            return upward
    return np.eye(3)[np.argmin(np.abs(line))]


def _points(chain: Linkage, q: Sequence[Jet], joints: tuple[int, int, int]) -> list[Jet]:
    """Return the positions of shoulder, elbow and wrist [m]."""
    return points_on_links(chain, q, [(joint, np.zeros(3)) for joint in joints])
