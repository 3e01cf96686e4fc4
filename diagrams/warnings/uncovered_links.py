"""What is said beforehand of links that are outside of the capsules by which distances are told."""

import itertools

import casadi as ca
import numpy as np
from pydrake.geometry import Box, Capsule, Convex, Cylinder, Ellipsoid, Mesh, Shape, Sphere
from pydrake.math import RigidTransform

from diagrams.robots.arm import Arm
from pfsc_drake.control.obstacles.obstacle_watch import ArmAhead
from pfsc_drake.geometry.segments import to_point
from pfsc_drake.robot.serial.outline import outline_points
from pfsc_drake.systems.drawing.robot_visualizer import BodyPart, Triangles

# m, by which a link may be outside without a word; rad or m, by which joints are bent
_ROUNDING, _BENT = 1e-3, 0.1
# directions round an axis in which the rim of a round part is looked at
_ROUND = np.linspace(0.0, 2.0 * np.pi, 36, endpoint=False)


def uncovered_links(part: Arm, drawn: list[BodyPart], ahead: ArmAhead) -> list[str]:
    """Return which links are outside of the capsules of an arm, one sentence or none.

    It is looked at with all joints at zero. What is before the second joint is left out, as it is
    of the capsules.

    Args:
        part: The arm as it is simulated.
        drawn: What it looks like.
        ahead: Its capsules.
    """
    outline, q_J = ahead.outline, np.zeros(ahead.chain.dimension)
    axis = outline_points(ahead.chain, outline)(q_J).full().reshape(-1, 3)
    bent = np.append(0.0, np.full(len(q_J) - 1, _BENT))
    poses, others = _poses(part, drawn, q_J), _poses(part, drawn, bent)
    farthest: dict[str, float] = {}
    for shown, pose, other in zip(drawn, poses, others, strict=True):
        if not pose.IsNearlyEqualTo(other, 1e-9):
            points = (pose @ shown.X_BP @ _corners(shown.form).T).T
            name = shown.body.name()
            farthest[name] = max(farthest.get(name, 0.0), _distances(points, axis).max())
    told = [
        f"{name} {distance:.3g} m"
        for name, distance in farthest.items()
        if distance > outline.radius + _ROUNDING
    ]
    if not told:
        return []
    return [
        f"obstacles.watch.arm_radius = {outline.radius:g} m; as far from the arm's axis are "
        f"{', '.join(told)}: no margin is kept from what is farther than the radius"
    ]


def _poses(part: Arm, drawn: list[BodyPart], q_J: np.ndarray) -> list[RigidTransform]:
    """Return the poses of the bodies of drawn parts, the arm being at rest."""
    context = part.model.CreateDefaultContext()
    part.model.SetPositionsAndVelocities(context, part.state_at_rest(q_J))
    return [part.model.EvalBodyPoseInWorld(context, each.body) for each in drawn]


def _corners(form: Shape | Triangles) -> np.ndarray:
    """Return points between which a form is, shape (n, 3) [m]."""
    if isinstance(form, Triangles):
        return form.vertices
    if isinstance(form, Mesh | Convex):
        hull = form.GetConvexHull()
        return np.array([hull.vertex(i) for i in range(hull.num_vertices())])
    if isinstance(form, Box):
        return np.array(list(itertools.product(*[(-s / 2.0, s / 2.0) for s in form.size()])))
    if isinstance(form, Cylinder | Capsule):
        r, half = form.radius(), form.length() / 2.0
        rim = np.column_stack([r * np.cos(_ROUND), r * np.sin(_ROUND), np.full(len(_ROUND), half)])
        end = half + (r if isinstance(form, Capsule) else 0.0)
        return np.vstack([rim, rim * [1.0, 1.0, -1.0], [[0.0, 0.0, end], [0.0, 0.0, -end]]])
    half_axes = np.zeros(3)
    if isinstance(form, Sphere):
        half_axes = np.full(3, form.radius())
    elif isinstance(form, Ellipsoid):
        half_axes = np.array([form.a(), form.b(), form.c()])
    return np.vstack([np.diag(half_axes), -np.diag(half_axes)])


def _distances(points: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Return distances of points from a polygon's sides, shape (n,) [m]."""
    point, least = ca.SX.sym("point", 3), ca.inf
    for a, b in itertools.pairwise(axis):
        least = ca.fmin(least, to_point(a, b, point))
    found: np.ndarray = ca.Function("from_axis", [point], [least])(points.T).full().ravel()
    return found
