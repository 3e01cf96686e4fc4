"""How far an arm is from obstacles, when they can be near, and where they are expected."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.obstacles.reach import Reach
from pfsc_drake.control.obstacles.shapes import Capsule, ObstacleShape
from pfsc_drake.geometry.segments import between_nearest, from_nearest, to_segment, to_swept


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
def nearness_function(
    shapes: Sequence[ObstacleShape], reach: Reach, spent: float, points: int, radius: float
) -> ca.Function:
    """Return ``(points, obstacles) -> (near, until)`` of an arm in one posture.

    ``near`` is its distance from the obstacles where they are measured, between surfaces [m],
    ``until`` the time until one of them may be nearer than ``spent`` whatever it does [s].

    Args:
        shapes: K obstacles.
        reach: How they can move.
        spent: Distance that is spent for the margin and for what is not known [m].
        points: P, of the arm's outline.
        radius: Of its capsules [m].
    """
    arm, obstacles = ca.SX.sym("points", 3 * points), ca.SX.sym("obstacles", 6 * len(shapes))
    links = list(itertools.pairwise(ca.vertsplit(arm, 3)))
    near, until = ca.inf, ca.inf
    for shape, obstacle in zip(shapes, ca.vertsplit(obstacles, 6), strict=True):
        axes, p, v = shape.axes, obstacle[:3], shape.axes * obstacle[3:]
        for part, (a, b) in itertools.product(shape.parts, links):
            away = away_from(axes * a, axes * b, axes * p, part)
            length = ca.norm_2(away)
            distance = length - (part.radius + radius)
            receding = ca.dot(away, v) / ca.fmax(length, 1e-9)
            near = ca.fmin(near, distance)
            until = ca.fmin(until, reach.time(distance - spent, receding))
    return ca.Function(
        "nearness", [arm, obstacles], [near, until], ["points", "obstacles"], ["near", "until"]
    )


@once_per_content()
def foresight_function(
    shapes: Sequence[ObstacleShape], foresight: Foresight, points: int, radius: float
) -> ca.Function:
    """Return ``(points, obstacles, arrival) -> ahead`` of an arm in one posture.

    ``ahead`` is the least distance from where obstacles are expected from the arm's arrival on [s]
    until the horizon, between surfaces [m]. How much an obstacle has spread is told by where on
    its way it is nearest.

    Args:
        shapes: K obstacles.
        foresight: How far they are foreseen.
        points: P, of the arm's outline.
        radius: Of its capsules [m].
    """
    arm, obstacles = ca.SX.sym("points", 3 * points), ca.SX.sym("obstacles", 6 * len(shapes))
    arrival = ca.SX.sym("arrival")
    begin = ca.fmin(arrival, foresight.horizon)
    lasts = foresight.horizon - begin
    links, ahead = list(itertools.pairwise(ca.vertsplit(arm, 3))), ca.inf
    for shape, obstacle in zip(shapes, ca.vertsplit(obstacles, 6), strict=True):
        axes, v = shape.axes, shape.axes * obstacle[3:]
        p, way = axes * obstacle[:3] + v * (foresight.age + begin), v * lasts
        for part, (a, b) in itertools.product(shape.parts, links):
            c = p + axes * ca.DM(part.start)
            if part.is_sphere:
                distance, share = to_segment(axes * a, axes * b, c, c + way)
            else:
                distance, share = to_swept(a, b, c, p + ca.DM(part.end), way)
            spread = foresight.spread * (begin + share * lasts)
            ahead = ca.fmin(ahead, distance - (part.radius + radius) - spread)
    names = ["points", "obstacles", "arrival"]
    return ca.Function("foresight", [arm, obstacles, arrival], [ahead], names, ["ahead"])


def away_from(a: Any, b: Any, p: Any, part: Capsule) -> Any:
    """Return the shortest vector from a segment to a capsule's line, shape (3,).

    Args:
        a: One end of the segment, shape (3,).
        b: The other one, shape (3,).
        p: Where the obstacle is that the capsule is a part of, shape (3,).
        part: The capsule.
    """
    if part.is_sphere:
        return from_nearest(a, b, p + ca.DM(part.start))
    away, _ = between_nearest(a, b, p + ca.DM(part.start), p + ca.DM(part.end))
    return -away


def least_distances(
    arm: np.ndarray, positions: np.ndarray, shapes: Sequence[ObstacleShape], radius: float
) -> np.ndarray:
    """Return the distance of a moving arm from each obstacle, between surfaces [m].

    Two lines are nearest at an end of one of them, or where they are nearest without ends.

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
        for part, (a, b) in itertools.product(shape.parts, itertools.pairwise(places)):
            c, d = p + np.array(part.start), p + np.array(part.end)
            distance = _between_lines(axes * a, axes * b, c, d)
            least = np.minimum(least, distance - part.radius - radius)
        found.append(least)
    return np.array(found).T


def _between_lines(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Return the distances of lines from a to b from those from c to d, each (samples, 3)."""
    least = np.minimum(_from_line(a, b, c), _from_line(a, b, d))
    least = np.minimum(least, np.minimum(_from_line(c, d, a), _from_line(c, d, b)))
    normal = np.cross(b - a, d - c)
    size = np.sum(normal**2, axis=1)
    area = np.maximum(size, 1e-18)
    first = np.sum(np.cross(c - a, d - c) * normal, axis=1) / area
    second = np.sum(np.cross(c - a, b - a) * normal, axis=1) / area
    crossing = (size > 1e-18) & (abs(first - 0.5) <= 0.5) & (abs(second - 0.5) <= 0.5)
    height = np.abs(np.sum((c - a) * normal, axis=1)) / np.sqrt(area)
    return np.where(crossing, np.minimum(height, least), least)


def _from_line(a: np.ndarray, b: np.ndarray, p: np.ndarray) -> np.ndarray:
    along, away = b - a, p - a
    length = np.maximum(np.sum(along**2, axis=1), 1e-12)
    share = np.clip(np.sum(away * along, axis=1) / length, 0.0, 1.0)
    return np.asarray(np.linalg.norm(away - share[:, None] * along, axis=1))
