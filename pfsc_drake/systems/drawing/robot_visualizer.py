"""Robots in Meshcat: arms from the positions of their plants, DELTA robots from their joints."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from pydrake.geometry import Meshcat, Rgba, Shape
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import Context, EventStatus, LeafSystem

from pfsc_drake.robot.delta.delta_robot import DeltaRobot
from pfsc_drake.robot.delta.shapes import (
    DARK,
    PLATE,
    robot_parts,
    rod_poses,
    rod_shape,
    slide_origins,
)

_ROOT = "visualizer"


@dataclass(frozen=True, eq=False)
class Triangles:
    """A triangle mesh.

    Attributes:
        vertices: Points [m], shape (v, 3).
        triangles: Indices of their corners, counterclockwise from outside, shape (t, 3).
    """

    vertices: np.ndarray
    triangles: np.ndarray


@dataclass(frozen=True, eq=False)
class BodyPart:
    """A drawn part that moves with a body of a plant.

    Attributes:
        body: The body B.
        name: Name, unique among the parts of the body.
        form: Shape.
        X_BP: Pose of the part's frame P in B.
        color: Colour, if the form has none of its own.
    """

    body: RigidBody
    name: str
    form: Shape | Triangles
    X_BP: RigidTransform = field(default_factory=RigidTransform)
    color: Rgba = field(default_factory=lambda: Rgba(0.9, 0.9, 0.9, 1.0))


def body_path(plant: MultibodyPlant, body: RigidBody, root: str = _ROOT) -> str:
    """Return the Meshcat path under which the parts of a body are drawn.

    Args:
        plant: The body's plant.
        body: The body.
        root: Path of all bodies.
    """
    return f"{root}/{plant.GetModelInstanceName(body.model_instance())}/{body.name()}"


class RobotVisualizer(LeafSystem):
    """Draws the parts of a plant's bodies.

    The plant provides only the poses of its bodies; it needs no geometry and is not in the diagram.
    Frames carry the time, so that a recording in progress contains them.

    Ports:
        positions (input): ``q`` of the plant, shape (num_positions,).

    Args:
        plant: The plant, finalized.
        parts: Parts to draw.
        meshcat: Meshcat instance, axes of the world.
        period: Time between frames [s].
        root: Path of all bodies.
    """

    def __init__(
        self,
        plant: MultibodyPlant,
        parts: Sequence[BodyPart],
        meshcat: Meshcat,
        period: float,
        root: str = _ROOT,
    ) -> None:
        super().__init__()
        self._plant, self._parts, self._meshcat, self._root = plant, parts, meshcat, root
        self._bodies = {body_path(plant, part.body, root): part.body for part in parts}
        # used for kinematics only; nothing in it outlives a frame
        self._kinematics = plant.CreateDefaultContext()
        self._positions = self.DeclareVectorInputPort("positions", plant.num_positions())
        self.DeclareInitializationPublishEvent(self._draw_parts)
        self.DeclarePeriodicPublishEvent(period, 0.0, self._draw)

    def _draw_parts(self, context: Context) -> EventStatus:
        for part in self._parts:
            path = f"{body_path(self._plant, part.body, self._root)}/{part.name}"
            if isinstance(part.form, Triangles):
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


_SCENE = "/drake"


def turn_scene_over(meshcat: Meshcat, height: float) -> None:
    """Show z_0 downwards: turn everything with relative paths about x_0, base on top.

    Args:
        meshcat: Meshcat instance.
        height: Height of the inertial frame's origin above the grid [m].
    """
    upside_down = RollPitchYaw(np.pi, 0.0, 0.0).ToRotationMatrix()
    meshcat.SetTransform(_SCENE, RigidTransform(upside_down, [0.0, 0.0, height]))


class DeltaVisualizer(LeafSystem):
    """Draws base, rails, slides, parallelogram rods and end-effector plate.

    It serves the analytic plant, the constrained plant and a replay of a log. Frames carry the
    time, so that a recording in progress contains them. Where the rods cannot meet, nothing moves.

    Ports:
        slide_positions (input): ``q`` [m], shape (3,).

    Args:
        robot: The robot.
        meshcat: Meshcat instance, in axes of the inertial frame (:func:`turn_scene_over`).
        period: Time between frames [s].
        root: Meshcat path of the robot.
    """

    def __init__(
        self, robot: DeltaRobot, meshcat: Meshcat, period: float, root: str = "delta_robot"
    ) -> None:
        super().__init__()
        self._robot, self._meshcat, self._root = robot, meshcat, root
        self._slide_positions = self.DeclareVectorInputPort("slide_positions", robot.dimension)
        self.DeclareInitializationPublishEvent(self._draw_parts)
        self.DeclarePeriodicPublishEvent(period, 0.0, self._draw)

    def _draw_parts(self, context: Context) -> EventStatus:
        parameters = self._robot.parameters
        for part in robot_parts(parameters):
            path = f"{self._root}/{part.carrier}/{part.name}"
            self._meshcat.SetObject(path, part.shape, part.color)
            self._meshcat.SetTransform(path, part.X_CS)
        for i in range(2 * self._robot.dimension):
            self._meshcat.SetObject(self._rod(i), rod_shape(parameters.geometry), DARK)
        self._draw(context)
        return EventStatus.Succeeded()

    def _draw(self, context: Context) -> None:
        q = self._slide_positions.Eval(context)
        y_t = self._robot.tool_position(q)
        if not np.all(np.isfinite(y_t)):
            return
        geometry, time = self._robot.parameters.geometry, context.get_time()
        for name, origin in zip(self._robot.names, slide_origins(geometry, q), strict=True):
            self._meshcat.SetTransform(f"{self._root}/{name}", RigidTransform(origin), time)
        self._meshcat.SetTransform(f"{self._root}/{PLATE}", RigidTransform(y_t), time)
        for i, pose in enumerate(rod_poses(geometry, q, y_t)):
            self._meshcat.SetTransform(self._rod(i), pose, time)

    def _rod(self, index: int) -> str:
        return f"{self._root}/rod_{index + 1}"
