"""How far an arm is from obstacles, now and where they are expected."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.errors import require_one_of, require_positive
from pfsc_drake.geometry.segments import to_point, to_segment

KINDS = ("sphere", "column")


@dataclass(frozen=True)
class ObstacleShape:
    """What moves: a sphere, or a column along z that has no end, as a person who stands.

    Attributes:
        kind: ``sphere`` or ``column``.
        radius: [m].
    """

    kind: str
    radius: float

    def __post_init__(self) -> None:
        require_one_of("kind", self.kind, KINDS)
        require_positive("radius", self.radius)

    @property
    def axes(self) -> ca.DM:
        """Which axes of the world count for distances, shape (3,)."""
        return ca.DM([1.0, 1.0, 0.0 if self.kind == "column" else 1.0])


@dataclass(frozen=True)
class Foresight:
    """How far obstacles are foreseen.

    An obstacle measured at p with velocity v some time ago is expected at ``p + v (age + t)``,
    within a radius that grows by ``spread t``.

    Attributes:
        age: Of what is measured [s].
        horizon: Until when [s].
        spread: By how much it may be beside, for each second ahead [m/s].
    """

    age: float
    horizon: float
    spread: float


@once_per_content()
def clearance_function(
    shapes: Sequence[ObstacleShape], foresight: Foresight, points: int, radius: float
) -> ca.Function:
    """Return ``(points, obstacles, arrival) -> (near, ahead)`` of an arm in one posture.

    ``near`` is its distance from the obstacles where they are measured, ``ahead`` the least one
    from where they are expected from ``arrival`` on [s] until the horizon, both between surfaces
    [m]. What an obstacle sweeps is a capsule, the distance is that of its axis from a link's; how
    much it has spread by then is told by the place on that axis.

    Args:
        shapes: K obstacles.
        foresight: How far they are foreseen.
        points: P, of the arm's outline.
        radius: Of its capsules [m].
    """
    arm, arrival = ca.SX.sym("points", 3 * points), ca.SX.sym("arrival")
    obstacles = ca.SX.sym("obstacles", 6 * len(shapes))
    begin = ca.fmin(arrival, foresight.horizon)
    places = ca.vertsplit(arm, 3)
    near, ahead = ca.inf, ca.inf
    for shape, obstacle in zip(shapes, ca.vertsplit(obstacles, 6), strict=True):
        axes, size = shape.axes, shape.radius + radius
        p, v = axes * obstacle[:3], axes * obstacle[3:]
        c = p + v * (foresight.age + begin)
        d = p + v * (foresight.age + foresight.horizon)
        for a, b in itertools.pairwise(places):
            near = ca.fmin(near, to_point(axes * a, axes * b, p) - size)
            distance, share = to_segment(axes * a, axes * b, c, d)
            time = begin + share * (foresight.horizon - begin)
            ahead = ca.fmin(ahead, distance - size - foresight.spread * time)
    return ca.Function(
        "clearance",
        [arm, obstacles, arrival],
        [near, ahead],
        ["points", "obstacles", "arrival"],
        ["near", "ahead"],
    )


def least_distances(
    arm: np.ndarray, positions: np.ndarray, shapes: Sequence[ObstacleShape], radius: float
) -> np.ndarray:
    """Return the distance of a moving arm from each obstacle, between surfaces [m].

    Args:
        arm: Points of its outline, shape (samples, 3P) [m].
        positions: Of K obstacles, shape (samples, 3K) [m].
        shapes: The obstacles.
        radius: Of the arm's capsules [m].

    Returns:
        Shape (samples, K).
    """
    found = []
    places = np.split(arm, arm.shape[1] // 3, axis=1)
    for k, shape in enumerate(shapes):
        axes = shape.axes.full().ravel()
        p, least = axes * positions[:, 3 * k : 3 * k + 3], np.full(len(arm), np.inf)
        for a, b in itertools.pairwise(places):
            along, away = axes * (b - a), p - axes * a
            length = np.maximum(np.sum(along**2, axis=1), 1e-12)
            share = np.clip(np.sum(away * along, axis=1) / length, 0.0, 1.0)
            distance = np.linalg.norm(away - share[:, None] * along, axis=1)
            least = np.minimum(least, distance - shape.radius - radius)
        found.append(least)
    return np.array(found).T
