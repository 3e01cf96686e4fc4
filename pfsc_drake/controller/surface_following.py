"""Surface following control of an arm in one call."""

from typing import Literal

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from pfsc_drake.control.manifolds.surface import SurfaceManifold
from pfsc_drake.controller.follower import Follower
from pfsc_drake.controller.options.follower_options import FollowerOptions
from pfsc_drake.controller.tasks.surface_task import SurfaceTask
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.geometry.surfaces.parametric_surface import Surface
from pfsc_drake.robot.robot_model import RobotModel


def add_surface_following(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    tool: str,
    surface: Surface,
    motion: PiecewisePolynomialCurve,
    law: str = "elastic",
    *,
    orientation: Literal["normal"] | None = None,
    offset: np.ndarray | None = None,
    start: tuple[float, float] | None = None,
    options: FollowerOptions | None = None,
) -> Follower:
    """Add a controller that lets a tool follow a surface, see :func:`add_path_following`.

    Args:
        builder: Builder of the diagram.
        plant: The robot, finalized: its nominal model.
        tool: Name of the frame whose origin follows the surface.
        surface: The surface, smooth enough for the law.
        motion: Two tangential coordinates over time [m], e.g. from
            :func:`~pfsc_drake.straight_lines`.
        law: Name of the law.
        orientation: ``normal``: the tool's axes are the axes of the surface, rotated by ``offset``;
            None if its orientation does not matter.
        offset: Rotation from the surface's axes to the tool's, shape (3, 3).
        start: Parameters theta of the start; the middle of the surface if omitted.
        options: Further options.

    Returns:
        The controller, one diagram with the ports of :class:`Follower`.

    Raises:
        InputError: If robot, surface, motion, law and options do not go together, or the start is
            out of reach.
    """
    chosen = options or FollowerOptions()
    if motion.dimension != 2:
        raise InputError(f"motion: {motion.dimension} coordinates; a surface has 2")

    def task(robot: RobotModel, posture: np.ndarray, relative_degree: int) -> SurfaceTask:
        manifold = SurfaceManifold(relative_degree, orientation=orientation, offset=offset)
        return SurfaceTask(surface, manifold, motion, theta=start or ())

    follower = Follower(plant, tool, law, task, chosen)
    builder.AddSystem(follower)
    return follower
