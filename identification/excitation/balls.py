"""Shapes covered by balls, whose distances are smooth functions of the joint positions."""

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Capsule, Cylinder, GeometryId, SceneGraphInspector, Sphere
from pydrake.math import RigidTransform

# edge of a box's cells by its least edge
_CELL = 1.0


@dataclass(frozen=True, eq=False)
class Balls:
    """Balls that cover something together.

    Attributes:
        centers: [m], shape (n, 3).
        radii: [m], shape (n,).
    """

    centers: np.ndarray
    radii: np.ndarray

    def placed(self, X_AB: RigidTransform) -> "Balls":
        """Return the balls of a frame B in frame A."""
        return Balls((X_AB @ self.centers.T).T.reshape(-1, 3), self.radii)

    def without_inner(self) -> "Balls":
        """Return the balls that are not inside another one."""
        order = np.argsort(-self.radii)
        kept: list[int] = []
        for i in order:
            depth = self.radii[kept] - np.linalg.norm(self.centers[kept] - self.centers[i], axis=1)
            if not np.any(depth >= self.radii[i]):
                kept.append(int(i))
        return Balls(self.centers[kept], self.radii[kept])


def join(groups: list[Balls]) -> Balls:
    """Return the balls of several groups."""
    if not groups:
        return Balls(np.zeros((0, 3)), np.zeros(0))
    return Balls(
        np.concatenate([g.centers for g in groups]), np.concatenate([g.radii for g in groups])
    )


def covering_balls(inspector: SceneGraphInspector, geometry: GeometryId) -> Balls:
    """Return balls that cover a shape, in its own frame.

    Spheres and capsules are covered without excess; of anything else than a cylinder the
    bounding box is. What has none, a half space, has no balls.

    Args:
        inspector: Of the scene graph.
        geometry: The shape.
    """
    shape = inspector.GetShape(geometry)
    if isinstance(shape, Sphere):
        return Balls(np.zeros((1, 3)), np.array([shape.radius()]))
    if isinstance(shape, Capsule | Cylinder):
        length, radius = shape.length(), shape.radius()
        number = max(1, int(np.ceil(length / radius)))
        pitch = length / number
        is_capsule = isinstance(shape, Capsule)
        places = np.arange(number + 1) - number / 2.0 if is_capsule else _middles(number)
        centers = np.column_stack([np.zeros((places.size, 2)), pitch * places])
        # between two balls a surface parallel to the axis sinks in
        return Balls(centers, np.full(places.size, np.hypot(radius, pitch / 2.0)))
    box = inspector.GetObbInGeometryFrame(geometry)
    if box is None:
        return join([])
    edges = 2.0 * np.asarray(box.half_width())
    numbers = np.maximum(1, np.ceil(edges / max(_CELL * edges.min(), edges.max() / 8.0))).astype(
        int
    )
    cells = edges / numbers
    grid = np.meshgrid(*(_middles(n) * cell for n, cell in zip(numbers, cells, strict=True)))
    centers = np.column_stack([axis.ravel() for axis in grid])
    radii = np.full(len(centers), np.linalg.norm(cells) / 2.0)
    return Balls(centers, radii).placed(box.pose())


def _middles(number: int) -> np.ndarray:
    """Middles of as many unit cells around zero."""
    return np.arange(number) - (number - 1) / 2.0
