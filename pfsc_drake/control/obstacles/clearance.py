"""Distances of an arm from measured, reachable and predicted positions of obstacles."""

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
    """Prediction of obstacles at constant velocity.

    An obstacle with the measured position p and velocity v is predicted at ``p + v (age + t)``,
    within a radius that grows by ``spread t``.

    Attributes:
        age: Age of the measurement [s].
        horizon: Prediction horizon [s].
        spread: Growth rate of the uncertainty radius [m/s].
    """

    age: float
    horizon: float
    spread: float


@once_per_content()
def nearness_function(
    shapes: Sequence[ObstacleShape], reach: Reach, spent: float, points: int, radius: float
) -> ca.Function:
    """Return ``(points, obstacles) -> (near, until)`` of an arm in one posture.

    ``near`` is its distance from the measured obstacles, between surfaces [m], ``until`` the
    earliest time at which one of them can be nearer than ``spent`` [s].

    Args:
        shapes: K obstacles.
        reach: Bounds of their motion.
        spent: Distance for the margin and uncertainties [m].
        points: Number P of points of the arm's outline.
        radius: Radius of the arm's capsules [m].
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

    ``ahead`` is the least distance from the predicted obstacles between the arm's arrival [s] and
    the horizon, between surfaces [m]. The spread is that at the nearest point of the predicted
    motion.

    Args:
        shapes: K obstacles.
        foresight: Prediction of the obstacles.
        points: Number P of points of the arm's outline.
        radius: Radius of the arm's capsules [m].
    """
    arm, obstacles = ca.SX.sym("points", 3 * points), ca.SX.sym("obstacles", 6 * len(shapes))
    arrival = ca.SX.sym("arrival")
    begin = ca.fmin(arrival, foresight.horizon)
    lasts = foresight.horizon - begin
    links, ahead = list(itertools.pairwise(ca.vertsplit(arm, 3))), ca.inf
    for shape, obstacle in zip(shapes, ca.vertsplit(obstacles, 6), strict=True):
        axes, v = shape.axes, shape.axes * obstacle[3:]
        p, travel = axes * obstacle[:3] + v * (foresight.age + begin), v * lasts
        for part, (a, b) in itertools.product(shape.parts, links):
            c = p + axes * ca.DM(part.start)
            if part.is_sphere:
                distance, share = to_segment(axes * a, axes * b, c, c + travel)
            else:
                distance, share = to_swept(a, b, c, p + ca.DM(part.end), travel)
            spread = foresight.spread * (begin + share * lasts)
            ahead = ca.fmin(ahead, distance - (part.radius + radius) - spread)
    names = ["points", "obstacles", "arrival"]
    return ca.Function("foresight", [arm, obstacles, arrival], [ahead], names, ["ahead"])


def away_from(a: Any, b: Any, p: Any, part: Capsule) -> Any:
    """Return the shortest vector from a segment to a capsule's line, shape (3,).

    Args:
        a: One end of the segment, shape (3,).
        b: The other end, shape (3,).
        p: Position of the obstacle that the capsule is a part of, shape (3,).
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

    Two segments are nearest at an end of one of them, or at the closest points of their lines.

    Args:
        arm: Points of the arm's outline, shape (samples, 3P) [m].
        positions: Positions of K obstacles, shape (samples, 3K) [m].
        shapes: The obstacles.
        radius: Radius of the arm's capsules [m].

    Returns:
        Shape (samples, K).
    """
    found = []
    corners = np.split(arm, arm.shape[1] // 3, axis=1)
    for k, shape in enumerate(shapes):
        axes = shape.axes.full().ravel()
        p, least = axes * positions[:, 3 * k : 3 * k + 3], np.full(len(arm), np.inf)
        for part, (a, b) in itertools.product(shape.parts, itertools.pairwise(corners)):
            c, d = p + np.array(part.start), p + np.array(part.end)
            distance = _between_lines(axes * a, axes * b, c, d)
            least = np.minimum(least, distance - part.radius - radius)
        found.append(least)
    return np.array(found).T


def _between_lines(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Return the distances of segments a to b from segments c to d, each (samples, 3)."""
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
