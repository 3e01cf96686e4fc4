"""The outline of an arm: capsules along its links, by which its distance from others is told."""

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

    What is before the second joint turns on the spot at most.

    Attributes:
        points: P points; of each the index of its link and where it is in that link's frame [m].
        radius: Of all capsules [m].
    """

    points: tuple[tuple[int, tuple[float, float, float]], ...]
    radius: float

    def __post_init__(self) -> None:
        require_positive("radius of the outline", self.radius)


def arm_outline(chain: SerialChain, radius: float) -> ArmOutline:
    """Return the outline of an arm.

    Args:
        chain: The arm, two joints or more.
        radius: Of its capsules [m], within which all of its links are.

    Raises:
        InputError: If there are fewer joints.
    """
    n = chain.dimension
    if n < 2:
        raise InputError(f"outline of an arm: {n} joint; allowed: two or more")
    middle = chain.gather("position_limits").clip(-np.pi, np.pi).mean(axis=1)
    every = [(k, (0.0, 0.0, 0.0)) for k in range(1, n)]
    places = outline_points(chain, ArmOutline(tuple(every), radius))(middle).full().reshape(-1, 3)
    kept, last = [every[0]], places[0]
    for point, place in zip(every[1:], places[1:], strict=True):
        if np.linalg.norm(place - last) >= _NEAR:
            kept.append(point)
            last = place
    x, y, z = (float(value) for value in chain.p_LT)
    return ArmOutline((*kept, (n - 1, (x, y, z))), radius)


@once_per_content()
def outline_points(chain: SerialChain, outline: ArmOutline) -> ca.Function:
    """Return ``q -> points``, where the outline's points are in the world, shape (3P,) [m].

    Args:
        chain: The arm, N joints.
        outline: Its outline.
    """
    q = ca.SX.sym("q", chain.dimension)
    still = [jets.constant(q[i], 1) for i in range(chain.dimension)]
    points = [(link, np.array(place)) for link, place in outline.points]
    places = [place.coefficients[0] for place in points_on_links(chain, still, points)]
    return ca.Function("outline", [q], [ca.densify(ca.vertcat(*places))], ["q"], ["points"])
