"""Allowed postures of a robot, as smooth functions of its joint positions that must be >= 0.

A search for motions needs gradients everywhere. Therefore shapes are covered by balls, corners of
obstacles are rounded and the least of many distances is a soft minimum; all of it is conservative.
Results are verified with the shapes themselves,
:class:`~identification.excitation.scene.RobotScene`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from identification.excitation.balls import (
    RobotBalls,
    cover,
    ends,
    points_of_last_link,
    remove_inner,
)
from identification.excitation.scene import WORLD, Cell, Obstacle, RobotScene
from identification.model.subject import Subject
from pfsc_drake import jets
from pfsc_drake.robot.delta.delta_robot import DeltaRobot
from pfsc_drake.robot.delta.kinematics import rod_motion

_SOFT = 0.004  # m, scale of the soft minimum
_ROUND = 0.02  # m, rounding of the obstacles' edges
_POSTURES = 800
# balls that are never nearer in random postures are left to the final verification [m]
_NEAR = 0.06
_ABOUT = 0.01  # m, difference of gaps that count as the least
_TINY = 1e-9  # m, to make roots differentiable
_FULL_TURN = np.pi


@dataclass(frozen=True, eq=False)
class PostureLimits:
    """Limits of a robot's postures.

    Attributes:
        function: ``g(q)``, CasADi function of a vector (N,) to (n,): zero or positive for allowed
            postures.
        names: Names of the elements, n of them.
    """

    function: ca.Function
    names: list[str]

    def values(self, q: np.ndarray) -> np.ndarray:
        """Return ``g`` of many samples, shape (K, n).

        Args:
            q: Joint positions [rad or m], shape (K, N).
        """
        return np.array(self.function.map(len(q))(q.T)).T


def serial_posture_limits(subject: Subject, cell: Cell, scene: RobotScene) -> PostureLimits | None:
    """Return the limits of a serial robot's postures in its cell; None if there are none.

    Args:
        subject: The robot.
        cell: Environment of the robot.
        scene: Robot and cell in Drake.
    """
    chain = subject.chain
    assert chain is not None
    balls = cover(chain, scene)
    lower, upper = np.clip(subject.position_limits, -_FULL_TURN, _FULL_TURN).T
    postures = np.random.default_rng(0).uniform(lower, upper, (_POSTURES, chain.dimension))
    sampled = balls.sample(postures)
    obstacles = cell.obstacles if balls.radii.size else []
    near = [(o, _near_obstacle(o, balls, scene, sampled, cell.clearance)) for o in obstacles]
    near = [(obstacle, numbers) for obstacle, numbers in near if numbers]
    pairs = _near_each_other(balls, scene, sampled, cell.clearance)
    used = {*(n for _, numbers in near for n in numbers), *(n for p in pairs for n in p)}
    q = ca.SX.sym("q", chain.dimension)
    at = balls.world_centers(q, sorted(used))
    elements: list[tuple[str, ca.SX]] = []
    if np.isfinite(cell.tool_above):
        # points between them are above, too
        tips = ends(subject)
        points = points_of_last_link(chain, list(tips.values())).world_centers(
            q, list(range(len(tips)))
        )
        for name, point in zip(tips, points.values(), strict=True):
            elements.append((height_of(name), point[2] - cell.tool_above))
    for obstacle, numbers in near:
        distances = [_distance(obstacle, at[n]) - balls.radii[n] for n in numbers]
        elements.append((f"clearance of {obstacle.name}", soft_min(distances) - cell.clearance))
    if pairs:
        gaps = [
            ca.sqrt(ca.sumsqr(at[a] - at[b]) + _TINY**2) - balls.radii[a] - balls.radii[b]
            for a, b in pairs
        ]
        elements.append(("clearance of the links", soft_min(gaps) - cell.clearance))
    if not elements:
        return None
    names = [name for name, _ in elements]
    g = ca.densify(ca.vertcat(*[value for _, value in elements]))
    return PostureLimits(ca.Function("g", [q], [g], ["q"], ["g"]), names)


def height_of(name: str) -> str:
    """Return the name of the limit of a point's height."""
    return f"height of the {name}"


def delta_posture_limits(robot: DeltaRobot) -> PostureLimits:
    """Return the limits of a DELTA robot's postures, see ``robot.delta.workspace``.

    The least singular value of the rods' directions U is bounded from below by the smooth function
    ``1 / |U^-1|_F = |det U| / |cof U|_F``.

    Args:
        robot: The robot.
    """
    geometry, least = robot.parameters.geometry, robot.parameters.workspace.min_rod_independence
    q = ca.SX.sym("q", robot.dimension)
    motion = rod_motion(geometry, [jets.constant(q[i], 1) for i in range(robot.dimension)])
    rods = [w.coefficients[0] / geometry.l_BC for w in motion.rods]
    cofactors = [ca.cross(rods[i], rods[(i + 1) % 3]) for i in range(3)]
    bound = ca.fabs(ca.dot(rods[0], cofactors[1])) / ca.norm_2(ca.vertcat(*cofactors))
    below = motion.y_t.coefficients[0][2] - geometry.h_P
    g = ca.densify(ca.vertcat(bound - least, below))
    return PostureLimits(
        ca.Function("g", [q], [g], ["q"], ["g"]),
        ["independence of the rods", "tool below the rails' common point"],
    )


def soft_min(values: Sequence[ca.SX], scale: float = _SOFT) -> ca.SX:
    """Return a smooth lower bound of the least of several numbers, within scale * log(n)."""
    return -scale * ca.logsumexp(ca.vertcat(*values) * (-1.0 / scale))


def soft_max(x: ca.SX, y: ca.SX, width: float = _ROUND) -> ca.SX:
    """Return a smooth lower bound of the larger of two numbers, within half of a width."""
    return (x + y + ca.sqrt((x - y) ** 2 + width**2) - width) / 2.0


def _distance(obstacle: Obstacle, point: ca.SX) -> ca.SX:
    """Return a lower bound of the distance to an obstacle [m], smooth outside of it."""
    x, y, z, roll, pitch, yaw = obstacle.pose()
    X_OW = RigidTransform(RollPitchYaw(roll, pitch, yaw), [x, y, z]).inverse()
    R_OW = ca.SX(ca.sparsify(ca.DM(np.round(X_OW.rotation().matrix(), 12))))
    p = R_OW @ point + X_OW.translation()
    if obstacle.kind == "sphere":
        return ca.sqrt(ca.sumsqr(p) + _TINY**2) - obstacle.radius
    if obstacle.kind == "box":
        beyond = [_magnitude(p[i]) - obstacle.size[i] / 2.0 for i in range(3)]
        return soft_max(soft_max(beyond[0], beyond[1]), beyond[2])
    half = float(np.linalg.norm(obstacle.end - obstacle.start)) / 2.0
    if obstacle.kind == "capsule":
        along = p[2] - ca.fmin(ca.fmax(p[2], -half), half)
        return ca.sqrt(p[0] ** 2 + p[1] ** 2 + along**2 + _TINY**2) - obstacle.radius
    aside = ca.sqrt(p[0] ** 2 + p[1] ** 2 + _TINY**2) - obstacle.radius
    return soft_max(aside, _magnitude(p[2]) - half)


def _magnitude(x: ca.SX) -> ca.SX:
    return ca.sqrt(x**2 + _TINY**2)


def _near_obstacle(
    obstacle: Obstacle,
    balls: RobotBalls,
    scene: RobotScene,
    sampled: np.ndarray,
    clearance: float,
) -> list[int]:
    """Return the balls nearest to an obstacle, without inner ones."""
    point = ca.SX.sym("p", 3)
    distance = ca.Function("d", [point], [_distance(obstacle, point)])
    count = len(balls.radii)
    flat = np.array(distance.map(sampled[..., 0].size)(sampled.reshape(-1, 3).T))
    gaps = flat.reshape(-1, count) - balls.radii
    bodies = np.array([scene.shapes[k].body if k >= 0 else "" for k in balls.shapes])
    gaps[:, (balls.links == WORLD) | np.isin(bodies, obstacle.beside)] = np.inf
    numbers = np.flatnonzero(_nearest(gaps, clearance)).tolist()
    per_link = [[n for n in numbers if balls.links[n] == i] for i in range(balls.chain.dimension)]
    return [n for own in per_link for n in remove_inner(balls, own)]


def _near_each_other(
    balls: RobotBalls, scene: RobotScene, sampled: np.ndarray, clearance: float
) -> list[tuple[int, int]]:
    """Return the nearest pairs of balls of shapes that must not touch."""
    index = {shape.geometry: k for k, shape in enumerate(scene.shapes)}
    of_links: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for pair in scene.pairs:
        if pair.second in index:
            firsts = np.flatnonzero(balls.shapes == index[pair.first])
            seconds = np.flatnonzero(balls.shapes == index[pair.second])
            links = int(balls.links[firsts[0]]), int(balls.links[seconds[0]])
            of_links.setdefault(links, []).extend((int(a), int(b)) for a in firsts for b in seconds)
    nearest = []
    for pairs in of_links.values():
        first, second = np.array(pairs).T
        gaps = np.linalg.norm(sampled[:, first] - sampled[:, second], axis=-1)
        gaps -= balls.radii[first] + balls.radii[second]
        nearest += [pairs[i] for i in np.flatnonzero(_nearest(gaps, clearance))]
    return nearest


def _nearest(gaps: np.ndarray, clearance: float) -> np.ndarray:
    """Return which gaps are nearly the least ones in postures where the least gap is small.

    Gaps that are small most of the time are so by design, or because balls are larger than their
    shapes; for them the final verification decides.

    Args:
        gaps: Distances of each posture [m], shape (K, n).
        clearance: Required clearance [m].

    Returns:
        Shape (n,).
    """
    gaps = np.where(np.median(gaps, axis=0) > clearance, gaps, np.inf)
    least = gaps.min(axis=1, keepdims=True)
    near = least < clearance + _NEAR
    return np.any(near & (gaps < least + _ABOUT), axis=0)
