"""A robot's shapes covered by balls, whose distances are smooth functions of joint positions."""

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
        links: Index of the link that carries each, from 0, or ``WORLD``; shape (n,).
        shapes: Index of the shape that each covers, in ``scene.shapes``, or -1; shape (n,).
        centers: In the link's frame [m], shape (n, 3).
        radii: [m], shape (n,).
    """

    chain: SerialChain
    links: np.ndarray
    shapes: np.ndarray
    centers: np.ndarray
    radii: np.ndarray

    def places(self, q: ca.SX, numbers: list[int]) -> dict[int, ca.SX]:
        """Return where the centres of some balls are in the world [m], by number.

        Args:
            q: Joint positions, shape (N, 1).
            numbers: Which balls.
        """
        still = [jets.constant(q[i], 1) for i in range(self.chain.dimension)]
        moving = [n for n in numbers if self.links[n] != WORLD]
        points = [(int(self.links[n]), self.centers[n]) for n in moving]
        jets_there = points_on_links(self.chain, still, points)
        places = {n: ca.SX(self.centers[n]) for n in numbers}
        return places | {n: p.coefficients[0] for n, p in zip(moving, jets_there, strict=True)}

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
        places = self.places(q, numbers)
        stacked = ca.densify(ca.vertcat(*[places[n] for n in numbers]))
        return ca.Function("centers", [q], [stacked])


def cover(chain: SerialChain, scene: RobotScene) -> RobotBalls:
    """Return balls that cover all shapes of a robot.

    Args:
        chain: The robot.
        scene: The same for Drake.
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
    """Return points of a serial robot's last link that its end effector lies between, by name.

    In the last link's frame [m], each (3,): of a robot whose tool is known the flange, and the tool
    point as long as the tool is there; of others the last joint and the tool point.

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
    """Return points of a robot's last link as balls without extent.

    Args:
        chain: The robot.
        points: In the last link's frame [m], n of shape (3,).
    """
    n = len(points)
    links = np.full(n, chain.dimension - 1)
    return RobotBalls(chain, links, np.full(n, -1), np.array(points), np.zeros(n))


def covering_balls(
    inspector: SceneGraphInspector, geometry: GeometryId
) -> tuple[np.ndarray, np.ndarray]:
    """Return balls that cover a shape together, centres [m] (n, 3) and radii [m] (n,).

    In the shape's frame. Of anything else than spheres, capsules and cylinders the bounding box is
    covered; what has none, a half space, has no balls.

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
        places = _middles(number + isinstance(shape, Capsule)) * pitch
        # between two balls a surface parallel to the axis sinks in
        radius = np.hypot(shape.radius(), pitch / 2.0)
        centers = np.column_stack([np.zeros((places.size, 2)), places])
        return centers, np.full(places.size, radius)
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


def without_inner(balls: RobotBalls, numbers: list[int]) -> list[int]:
    """Return those of some balls of one link that are not inside another of them."""
    kept: list[int] = []
    for n in sorted(numbers, key=lambda n: -balls.radii[n]):
        gaps = np.linalg.norm(balls.centers[kept] - balls.centers[n], axis=1)
        if not np.any(balls.radii[kept] - gaps >= balls.radii[n]):
            kept.append(n)
    return kept


def _middles(number: int) -> np.ndarray:
    """Middles of as many unit cells around zero."""
    return np.arange(number) - (number - 1) / 2.0
