"""A robot in Meshcat, from the positions of its plant."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from pydrake.geometry import Meshcat, Rgba, Shape
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import Context, EventStatus, LeafSystem

_ROOT = "visualizer"


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles.

    Attributes:
        vertices: Points [m], shape (v, 3).
        triangles: Indices of their corners, counterclockwise from outside, shape (t, 3).
    """

    vertices: np.ndarray
    triangles: np.ndarray


@dataclass(frozen=True, eq=False)
class BodyPart:
    """Something drawn that moves with a body of a plant.

    Attributes:
        body: The body B.
        name: Name, of its own among the parts of the body.
        form: What it looks like.
        X_BP: Pose of the part's frame P in B.
        color: Colour, where the form has none of its own.
    """

    body: RigidBody
    name: str
    form: Shape | Surface
    X_BP: RigidTransform = field(default_factory=RigidTransform)
    color: Rgba = field(default_factory=lambda: Rgba(0.9, 0.9, 0.9, 1.0))


def body_path(plant: MultibodyPlant, body: RigidBody) -> str:
    """Return the Meshcat path under which the parts of a body are drawn.

    Args:
        plant: The body's plant.
        body: The body.
    """
    return f"{_ROOT}/{plant.GetModelInstanceName(body.model_instance())}/{body.name()}"


class RobotVisualizer(LeafSystem):
    """Draws the parts of a plant's bodies.

    The plant only says where its bodies are; it needs no geometry and stands in no diagram here.
    Frames carry the time, so that a recording in progress gets them.

    Ports:
        positions (input): ``q`` of the plant, shape (num_positions,).

    Args:
        plant: The plant, finalized.
        parts: What to draw.
        meshcat: Where to draw, axes of the world.
        period: Time between frames [s].
    """

    def __init__(
        self, plant: MultibodyPlant, parts: Sequence[BodyPart], meshcat: Meshcat, period: float
    ) -> None:
        super().__init__()
        self._plant, self._parts, self._meshcat = plant, parts, meshcat
        self._bodies = {body_path(plant, part.body): part.body for part in parts}
        # a worksheet for kinematics; nothing in it outlives a frame
        self._kinematics = plant.CreateDefaultContext()
        self._positions = self.DeclareVectorInputPort("positions", plant.num_positions())
        self.DeclareInitializationPublishEvent(self._draw_parts)
        self.DeclarePeriodicPublishEvent(period, 0.0, self._draw)

    def _draw_parts(self, context: Context) -> EventStatus:
        for part in self._parts:
            path = f"{body_path(self._plant, part.body)}/{part.name}"
            if isinstance(part.form, Surface):
                corners, triangles = part.form.vertices.T, part.form.triangles.T
                self._meshcat.SetTriangleMesh(path, corners, triangles, part.color)
            else:
                self._meshcat.SetObject(path, part.form, part.color)
            self._meshcat.SetTransform(path, part.X_BP)
        self._draw(context)
        return EventStatus.Succeeded()

    def _draw(self, context: Context) -> None:
        self._plant.SetPositions(self._kinematics, self._positions.Eval(context))
        for path, body in self._bodies.items():
            X_WB = body.EvalPoseInWorld(self._kinematics)
            self._meshcat.SetTransform(path, X_WB, context.get_time())
