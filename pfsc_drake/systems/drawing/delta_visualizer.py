"""A DELTA robot in Meshcat, from its slide positions alone."""

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.math import RigidTransform, RollPitchYaw
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

_SCENE = "/drake"


def turn_scene_over(meshcat: Meshcat, height: float) -> None:
    """Show z_0 downwards: turn all that is drawn by relative paths about x_0, base on top.

    Args:
        meshcat: Where things are drawn.
        height: Of the inertial frame's origin above the grid [m].
    """
    upside_down = RollPitchYaw(np.pi, 0.0, 0.0).ToRotationMatrix()
    meshcat.SetTransform(_SCENE, RigidTransform(upside_down, [0.0, 0.0, height]))


class DeltaVisualizer(LeafSystem):
    """Draws base, rails, slides, parallelogram rods and end-effector plate.

    It serves the analytic plant as well as the constrained one, and a replay of a log. Frames
    carry the time, so that a recording in progress gets them. Where the rods cannot meet,
    nothing moves.

    Ports:
        slide_positions (input): ``q`` [m], shape (3,).

    Args:
        robot: The robot.
        meshcat: Where to draw, in axes of the inertial frame (:func:`turn_scene_over`).
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
