"""Obstacles in Meshcat: spheres, and columns for persons with the space that they may need."""

from collections.abc import Sequence

import numpy as np
from pydrake.geometry import Capsule, Cylinder, Meshcat, Rgba, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context, EventStatus, LeafSystem

from pfsc_drake.control.obstacles.shapes import ObstacleShape

_ROOT = "/drake/obstacles"
# m, of a person who stands on the floor z = 0
_HEIGHT, _BODY, _HEAD, _RIM = 1.75, 0.17, 0.11, 0.005
OBSTACLE_COLOR, _ROOM, MARGIN_COLOR = (
    Rgba(0.12, 0.32, 0.52, 1.0),
    Rgba(0.2, 0.5, 0.8, 0.18),
    Rgba(0.85, 0.2, 0.15, 0.28),
)


class ObstacleVisualizer(LeafSystem):
    """Draws obstacles, and around them the safety distance.

    Ports:
        positions (input): Positions of K obstacles [m], shape (3K,).

    Args:
        shapes: Shapes of the obstacles.
        margin: Safety distance [m].
        meshcat: Meshcat instance, axes of the world.
        period: Time between frames [s].
    """

    def __init__(
        self, shapes: Sequence[ObstacleShape], margin: float, meshcat: Meshcat, period: float
    ) -> None:
        super().__init__()
        self._shapes, self._margin, self._meshcat = shapes, margin, meshcat
        self._positions = self.DeclareVectorInputPort("positions", 3 * len(shapes))
        self.DeclareInitializationPublishEvent(self._begin)
        self.DeclarePeriodicPublishEvent(period, 0.0, self._draw)

    def _begin(self, context: Context) -> EventStatus:
        for k, shape in enumerate(self._shapes):
            path, r = f"{_ROOT}/{k}", shape.radius
            if shape.kind == "sphere":
                self._meshcat.SetObject(f"{path}/body", Sphere(r), OBSTACLE_COLOR)
                self._meshcat.SetObject(f"{path}/margin", Sphere(r + self._margin), MARGIN_COLOR)
                continue
            if shape.kind == "capsules":
                self._draw_parts(path, shape)
                continue
            body = min(_BODY, r)
            length = _HEIGHT - 2.0 * _HEAD - 2.0 * body
            parts = {
                "body": (Capsule(body, length), OBSTACLE_COLOR, body + length / 2.0),
                "head": (Sphere(_HEAD), OBSTACLE_COLOR, _HEIGHT - _HEAD),
                "room": (Cylinder(r, _HEIGHT), _ROOM, _HEIGHT / 2.0),
                "margin": (Cylinder(r + self._margin, _RIM), MARGIN_COLOR, _RIM / 2.0),
            }
            for name, (form, colour, height) in parts.items():
                self._meshcat.SetObject(f"{path}/{name}", form, colour)
                self._meshcat.SetTransform(f"{path}/{name}", RigidTransform([0.0, 0.0, height]))
        self._draw(context)
        return EventStatus.Succeeded()

    def _draw_parts(self, path: str, shape: ObstacleShape) -> None:
        for i, part in enumerate(shape.parts):
            start, axis = np.array(part.start), np.subtract(part.end, part.start)
            length, r = float(np.linalg.norm(axis)), part.radius
            pose = RigidTransform(start)
            if length:
                R_WP = RotationMatrix.MakeFromOneVector(axis, 2)
                pose = RigidTransform(R_WP, start + axis / 2.0)
            for name, radius, colour in (
                ("body", r, OBSTACLE_COLOR),
                ("margin", r + self._margin, MARGIN_COLOR),
            ):
                form = Capsule(radius, length) if length else Sphere(radius)
                self._meshcat.SetObject(f"{path}/{name}_{i}", form, colour)
                self._meshcat.SetTransform(f"{path}/{name}_{i}", pose)

    def _draw(self, context: Context) -> None:
        positions = np.array(self._positions.Eval(context)).reshape(-1, 3)
        for k, (shape, position) in enumerate(zip(self._shapes, positions, strict=True)):
            origin = position * shape.axes.full().ravel()
            self._meshcat.SetTransform(f"{_ROOT}/{k}", RigidTransform(origin), context.get_time())
