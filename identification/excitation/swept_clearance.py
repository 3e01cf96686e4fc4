"""Distances between a robot and its environment, for all postures of a motion.

Drake's engine computes the distances at instants. In between, two shapes approach no faster than
the joints between them turn times the reach of the shapes from their axes. If that does not exclude
less than the required distance, the interval is divided.
"""

from dataclasses import dataclass

import numpy as np

from identification.excitation.balls import RobotBalls, cover
from identification.excitation.fourier import FourierTrajectory
from identification.excitation.scene import WORLD, RobotScene
from pfsc_drake.robot.serial.chain import SerialChain

_INSTANTS = 400  # per period, at first
_SHORTEST = 2e-6  # of a period, intervals that are not divided further
_ROUNDING = 1.02  # levers are evaluated at instants only


@dataclass(frozen=True)
class SweptClearance:
    """Distances along a motion.

    Attributes:
        least: Least distance at all evaluated instants [m].
        guaranteed: No distance is less, at any time [m].
        pair: Names of the nearest shapes; empty without pairs.
        time: Time of the least distance [s].
        instants: Number of evaluated instants.
    """

    least: float
    guaranteed: float
    pair: str
    time: float
    instants: int


def swept_clearance(
    chain: SerialChain,
    scene: RobotScene,
    trajectory: FourierTrajectory,
    required: float,
    tolerance: float = 0.002,
) -> SweptClearance:
    """Return the distances of one period.

    Args:
        chain: The robot.
        scene: The robot with its cell in Drake.
        trajectory: Its motion.
        required: Required distance [m]; far larger distances are not evaluated exactly.
        tolerance: Intervals are divided until the guaranteed distance is that close to it [m].
    """
    if not scene.pairs:
        return SweptClearance(np.inf, np.inf, "", 0.0, 0)
    t = np.linspace(0.0, trajectory.period, _INSTANTS + 1)
    q, _, _ = trajectory.motion(t)
    weights = _reach_between(chain, scene, q)
    distances = scene.distances(q)
    nearest = _nearest(scene, t, distances)
    bounds = _between(trajectory, t[:-1], t[1:], distances[:-1], distances[1:], weights)
    goal = required - tolerance
    near = np.any(bounds < goal, axis=0)
    guaranteed = float(bounds[:, ~near].min(initial=np.inf))
    # pairs that are far apart in all intervals are never evaluated again
    pairs, weights = np.flatnonzero(near), weights[near]
    left, right, bounds = t[:-1], t[1:], bounds[:, near]
    at_left, at_right = distances[:-1, near], distances[1:, near]
    instants = len(t)
    while pairs.size:
        lowest = bounds.min(axis=1)
        # dividing does not help if an instant itself falls short, or in such short intervals
        known = (lowest >= goal) | (np.minimum(at_left, at_right).min(axis=1) < goal)
        known |= right - left < _SHORTEST * trajectory.period
        guaranteed = min(guaranteed, float(lowest[known].min(initial=np.inf)))
        left, right = left[~known], right[~known]
        if not left.size:
            break
        middle = (left + right) / 2.0
        at_middle = scene.distances(trajectory.motion(middle)[0], pairs)
        instants += len(middle)
        nearest = min(nearest, _nearest(scene, middle, at_middle, pairs))
        at_left = np.vstack([at_left[~known], at_middle])
        at_right = np.vstack([at_middle, at_right[~known]])
        left, right = np.concatenate([left, middle]), np.concatenate([middle, right])
        bounds = _between(trajectory, left, right, at_left, at_right, weights)
    least, time, pair = nearest
    return SweptClearance(least, guaranteed, pair, time, instants)


def _nearest(
    scene: RobotScene,
    times: np.ndarray,
    distances: np.ndarray,
    pairs: np.ndarray | None = None,
) -> tuple[float, float, str]:
    """Return the least of some distances [m], its time [s] and its pair."""
    row, column = np.unravel_index(np.argmin(distances), distances.shape)
    pair = scene.pairs[int(column) if pairs is None else int(pairs[column])]
    return float(distances[row, column]), float(times[row]), pair.name


def _between(
    trajectory: FourierTrajectory,
    left: np.ndarray,
    right: np.ndarray,
    at_left: np.ndarray,
    at_right: np.ndarray,
    weights: np.ndarray,
) -> np.ndarray:
    """Return lower bounds of distances within intervals [m], shape (K, pairs).

    Args:
        trajectory: The motion.
        left: Beginnings of the intervals [s], shape (K,).
        right: Ends of the intervals [s], shape (K,).
        at_left: Distances there [m], shape (K, pairs).
        at_right: Distances there [m], shape (K, pairs).
        weights: Influence of each joint on each distance [m/rad or 1], shape (pairs, N).
    """
    length = (right - left)[:, None]
    speeds = [np.abs(trajectory.motion(t)[1]) for t in (left, right)]
    w = 2.0 * np.pi / trajectory.period * np.array(trajectory.harmonics)
    acceleration = np.hypot(trajectory.a, trajectory.b) @ w
    speed = np.maximum(*speeds) + acceleration * length / 2.0
    # falling with one slope from the left, and with the same from the right
    return (at_left + at_right - length * (speed @ weights.T)) / 2.0


def _reach_between(chain: SerialChain, scene: RobotScene, q: np.ndarray) -> np.ndarray:
    """Return the largest approach of pairs of shapes per speed of each joint [m or 1].

    Args:
        chain: The robot, N joints.
        scene: Robot and cell in Drake.
        q: Joint positions of the motion, shape (K, N).

    Returns:
        Shape (pairs, N).
    """
    n = chain.dimension
    balls = cover(chain, scene)
    axes = np.array([link.axis for link in chain.links])
    points = np.concatenate([np.zeros((n, 3)), axes])
    links, none = np.tile(np.arange(n), 2), np.zeros(2 * n)
    on_axes = RobotBalls(chain, links, np.full(2 * n, -1), points, none)
    centers = on_axes.sample(q)
    origins, directions = centers[:, :n], centers[:, n:] - centers[:, :n]
    lever = np.empty((len(balls.radii), n))
    for j, link in enumerate(chain.links):
        arm = balls.sample(q) - origins[:, None, j]
        across = np.linalg.norm(np.cross(arm, directions[:, None, j]), axis=-1).max(axis=0)
        lever[:, j] = _ROUNDING * across + balls.radii if link.is_revolute else 1.0
    index = {shape.geometry: k for k, shape in enumerate(scene.shapes)}
    weights = np.zeros((len(scene.pairs), n))
    for row, pair in zip(weights, scene.pairs, strict=True):
        first = index[pair.first]
        second = index.get(pair.second, first)
        inner_link, outer_link = WORLD, scene.shapes[first].link
        if second != first:
            inner_link, outer_link = sorted([outer_link, scene.shapes[second].link])
        outer = second if scene.shapes[second].link == outer_link else first
        between = slice(inner_link + 1, outer_link + 1)
        row[between] = lever[balls.shapes == outer][:, between].max(axis=0)
    return weights
