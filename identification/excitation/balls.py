"""Balls that cover a robot's shapes, whose distances are smooth functions of joint positions."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from pydrake.geometry import Capsule, Cylinder, GeometryId, SceneGraphInspector, Sphere

from identification.excitation.scene import WORLD, RobotScene
from identification.model.subject import Subject
from pfsc_drake import jets
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.newton_euler import points_on_links

_MOST_CELLS = 8  # along the longest edge of a box


@dataclass(frozen=True, eq=False)
class RobotBalls:
    """Balls on the links of a robot.

    Attributes:
        chain: The robot, N joints.
        links: Index of the link of each ball, from 0, or ``WORLD``; shape (n,).
        shapes: Index of the covered shape of each ball in ``scene.shapes``, or -1; shape (n,).
        centers: Centres in the link's frame [m], shape (n, 3).
        radii: Radii [m], shape (n,).
    """

    chain: SerialChain
    links: np.ndarray
    shapes: np.ndarray
    centers: np.ndarray
    radii: np.ndarray

    def world_centers(self, q: ca.SX, numbers: list[int]) -> dict[int, ca.SX]:
        """Return the centres of some balls in the world [m], by number.

        Args:
            q: Joint positions, shape (N, 1).
            numbers: Numbers of the balls.
        """
        still = [jets.constant(q[i], 1) for i in range(self.chain.dimension)]
        moving = [n for n in numbers if self.links[n] != WORLD]
        points = [(int(self.links[n]), self.centers[n]) for n in moving]
        jets_there = points_on_links(self.chain, still, points)
        world_centers = {n: ca.SX(self.centers[n]) for n in numbers}
        return world_centers | {
            n: p.coefficients[0] for n, p in zip(moving, jets_there, strict=True)
        }

    def sample(self, q: np.ndarray) -> np.ndarray:
        """Return the centres of all balls in the world [m], shape (K, n, 3).

        Args:
            q: Joint positions, shape (K, N).
        """
        return np.array(self._all(q.T)).T.reshape(len(q), -1, 3)

    @cached_property
    def _all(self) -> ca.Function:
        q = ca.SX.sym("q", self.chain.dimension)
        numbers = list(range(len(self.radii)))
        world_centers = self.world_centers(q, numbers)
        stacked = ca.densify(ca.vertcat(*[world_centers[n] for n in numbers]))
        return ca.Function("centers", [q], [stacked])


def cover(chain: SerialChain, scene: RobotScene) -> RobotBalls:
    """Return balls that cover all shapes of a robot.

    Args:
        chain: The robot.
        scene: The robot and its cell in Drake.
    """
    links, shapes, centers, radii = [], [], [], []
    for k, shape in enumerate(scene.shapes):
        for center, radius in zip(*covering_balls(scene.inspector, shape.geometry), strict=True):
            links.append(shape.link)
            shapes.append(k)
            centers.append(shape.X_LG @ center)
            radii.append(radius)
    return RobotBalls(
        chain,
        np.array(links, dtype=int),
        np.array(shapes, dtype=int),
        np.reshape(centers, (-1, 3)),
        np.array(radii),
    )


def ends(subject: Subject) -> dict[str, np.ndarray]:
    """Return points of a serial robot's last link that bound its end effector, by name.

    In the last link's frame [m], each (3,): for a robot with known tool the flange, and the tool
    point if the tool is attached; for others the last joint and the tool point.

    Args:
        subject: The robot.
    """
    chain, parameters = subject.chain, subject.parameters
    assert chain is not None
    if parameters is None:
        return {"last joint": np.zeros(3), "tool point": chain.p_LT}
    flange = chain.p_LT - chain.R_LT @ parameters.tool.tool_point
    return {"flange": flange} | ({"tool point": chain.p_LT} if subject.tool else {})


def points_of_last_link(chain: SerialChain, points: Sequence[np.ndarray]) -> RobotBalls:
    """Return points of a robot's last link as balls of radius zero.

    Args:
        chain: The robot.
        points: Points in the last link's frame [m], n of shape (3,).
    """
    n = len(points)
    links = np.full(n, chain.dimension - 1)
    return RobotBalls(chain, links, np.full(n, -1), np.array(points), np.zeros(n))


def covering_balls(
    inspector: SceneGraphInspector, geometry: GeometryId
) -> tuple[np.ndarray, np.ndarray]:
    """Return balls that together cover a shape, centres [m] (n, 3) and radii [m] (n,).

    In the shape's frame. Spheres, capsules and cylinders are covered themselves, other shapes by
    their bounding box; a half space, which has none, has no balls.

    Args:
        inspector: Inspector of the scene graph.
        geometry: The shape.
    """
    shape = inspector.GetShape(geometry)
    if isinstance(shape, Sphere):
        return np.zeros((1, 3)), np.array([shape.radius()])
    if isinstance(shape, Capsule | Cylinder):
        number = max(1, int(np.ceil(shape.length() / shape.radius())))
        pitch = shape.length() / number
        # the ends of a capsule are balls themselves
        offsets = _middles(number + isinstance(shape, Capsule)) * pitch
        # between two balls their union is thinner than the shape
        radius = np.hypot(shape.radius(), pitch / 2.0)
        centers = np.column_stack([np.zeros((offsets.size, 2)), offsets])
        return centers, np.full(offsets.size, radius)
    box = inspector.GetObbInGeometryFrame(geometry)
    if box is None:
        return np.zeros((0, 3)), np.zeros(0)
    edges = 2.0 * np.asarray(box.half_width())
    numbers = np.ceil(edges / max(edges.min(), edges.max() / _MOST_CELLS)).astype(int)
    cells = edges / numbers
    axes = [_middles(n) * cell for n, cell in zip(numbers, cells, strict=True)]
    centers = np.column_stack([axis.ravel() for axis in np.meshgrid(*axes)])
    radii = np.full(len(centers), np.linalg.norm(cells) / 2.0)
    return (box.pose() @ centers.T).T, radii


def remove_inner(balls: RobotBalls, numbers: list[int]) -> list[int]:
    """Return those of some balls of one link that are not inside another of them."""
    outer: list[int] = []
    for n in sorted(numbers, key=lambda n: -balls.radii[n]):
        gaps = np.linalg.norm(balls.centers[outer] - balls.centers[n], axis=1)
        if not np.any(balls.radii[outer] - gaps >= balls.radii[n]):
            outer.append(n)
    return outer


def _middles(number: int) -> np.ndarray:
    """Return the centres of as many unit cells around zero."""
    return np.arange(number) - (number - 1) / 2.0
