"""Warning about links outside of the capsules that model the arm's distance from obstacles."""

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

# m, by which a link may be outside without a warning; rad or m, by which joints are bent
_ROUNDING, _BENT = 1e-3, 0.1
# directions round an axis in which the rim of a round part is sampled
_ROUND = np.linspace(0.0, 2.0 * np.pi, 36, endpoint=False)


def uncovered_links(part: Arm, drawn: list[BodyPart], ahead: ArmAhead) -> list[str]:
    """Return the links that are outside of the capsules of an arm, in one sentence or none.

    They are checked with all joints at zero. Links before the second joint are left out, since the
    capsules leave them out too.

    Args:
        part: The simulated arm.
        drawn: Its visual geometry.
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
    uncovered = [
        f"{name} {distance:.3g} m"
        for name, distance in farthest.items()
        if distance > outline.radius + _ROUNDING
    ]
    if not uncovered:
        return []
    return [
        f"obstacles.watch.arm_radius = {outline.radius:g} m; as far from the arm's axis are "
        f"{', '.join(uncovered)}: the margin does not hold for parts farther away than the radius"
    ]


def _poses(part: Arm, drawn: list[BodyPart], q_J: np.ndarray) -> list[RigidTransform]:
    """Return the poses of the bodies of drawn parts, for an arm at rest."""
    context = part.model.CreateDefaultContext()
    part.model.SetPositionsAndVelocities(context, part.state_at_rest(q_J))
    return [part.model.EvalBodyPoseInWorld(context, each.body) for each in drawn]


def _corners(form: Shape | Triangles) -> np.ndarray:
    """Return points whose convex hull contains a form, shape (n, 3) [m]."""
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
