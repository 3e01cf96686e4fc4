"""Outline of an arm: capsules along its links, for distances from obstacles."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from pfsc_drake import jets
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.errors import InputError, require_positive
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.newton_euler import points_on_links

# m, from joint to joint, below which both are one point of the outline
_NEAR = 0.1


@dataclass(frozen=True)
class ArmOutline:
    """Capsules of one radius, end to end, from the second joint's origin to the tool point.

    Parts before the second joint are ignored: they turn on the spot at most.

    Attributes:
        points: P points, each by the index of its link and its position in the link's frame [m].
        radius: Radius of all capsules [m].
    """

    points: tuple[tuple[int, tuple[float, float, float]], ...]
    radius: float

    def __post_init__(self) -> None:
        require_positive("radius of the outline", self.radius)


def arm_outline(chain: SerialChain, radius: float) -> ArmOutline:
    """Return the outline of an arm.

    Args:
        chain: The arm, two joints or more.
        radius: Radius of its capsules [m], which contain all of its links.

    Raises:
        InputError: If there are fewer joints.
    """
    n = chain.dimension
    if n < 2:
        raise InputError(f"outline of an arm: {n} joint; allowed: two or more")
    middle = chain.gather("position_limits").clip(-np.pi, np.pi).mean(axis=1)
    every = [(k, (0.0, 0.0, 0.0)) for k in range(1, n)]
    positions = (
        outline_points(chain, ArmOutline(tuple(every), radius))(middle).full().reshape(-1, 3)
    )
    selected, last = [every[0]], positions[0]
    for point, position in zip(every[1:], positions[1:], strict=True):
        if np.linalg.norm(position - last) >= _NEAR:
            selected.append(point)
            last = position
    x, y, z = (float(value) for value in chain.p_LT)
    return ArmOutline((*selected, (n - 1, (x, y, z))), radius)


@once_per_content()
def outline_points(chain: SerialChain, outline: ArmOutline) -> ca.Function:
    """Return ``q -> points``, the outline's points in the world, shape (3P,) [m].

    Args:
        chain: The arm, N joints.
        outline: Its outline.
    """
    q = ca.SX.sym("q", chain.dimension)
    still = [jets.constant(q[i], 1) for i in range(chain.dimension)]
    points = [(link, np.array(position)) for link, position in outline.points]
    positions = [position.coefficients[0] for position in points_on_links(chain, still, points)]
    return ca.Function("outline", [q], [ca.densify(ca.vertcat(*positions))], ["q"], ["points"])
