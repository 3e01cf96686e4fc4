"""Path following control of an arm in one call."""

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from pfsc_drake.control.law.reference import rest_to_rest
from pfsc_drake.control.manifolds.moving_point import MovingPoint
from pfsc_drake.controller.follower import Follower
from pfsc_drake.controller.options.follower_options import FollowerOptions
from pfsc_drake.controller.tasks.path_task import PathTask
from pfsc_drake.geometry import Path, PiecewisePolynomialCurve
from pfsc_drake.geometry.paths.path_warnings import path_warnings
from pfsc_drake.robot.robot_model import RobotModel

_VELOCITY, _ACCELERATION = 0.1, 0.5  # m/s, m/s^2


def add_path_following(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    tool: str,
    path: Path,
    law: str = "elastic",
    *,
    motion: PiecewisePolynomialCurve | None = None,
    options: FollowerOptions | None = None,
) -> Follower:
    """Add a controller that lets a tool follow a path.

    ::

        follower = add_path_following(builder, plant, "tcp", path, law="rigid")
        builder.Connect(plant.get_state_output_port(), follower.GetInputPort("plant_state"))
        builder.Connect(follower.GetOutputPort("actuation"), plant.get_actuation_input_port())

    No port is connected: the measured state may come from encoders, and the drives may be real.

    Args:
        builder: Builder of the diagram.
        plant: The robot, finalized: its nominal model.
        tool: Name of the frame whose origin follows the path, with its orientation if the path
            has one.
        path: The path, smooth enough for the law.
        law: ``velocity_servo``, ``rigid``, ``singular_perturbation``, ``visco_elastic`` or
            ``elastic``.
        motion: Arc length over time [m], e.g. from :func:`~pfsc_drake.rest_to_rest`; along the
            whole path once if omitted.
        options: Further options; with ``controller.manifold`` = ``trajectory`` a trajectory is
            tracked, for comparison (Sec. 3.8.4).

    Returns:
        The controller, one diagram with the ports of :class:`Follower`.

    Raises:
        InputError: If robot, path, law and options do not go together, or the start is out of
            reach.
    """
    chosen = options or FollowerOptions()
    along = motion or rest_to_rest(
        [0.0, path.length], velocity=_VELOCITY, acceleration=_ACCELERATION
    )

    def task(robot: RobotModel, posture: np.ndarray, relative_degree: int) -> PathTask:
        tracks = chosen.controller.manifold == MovingPoint.name
        path_task = PathTask(path, along, relative_degree, tracks=tracks)
        path_task.warnings += path_warnings(path, path_task.shape, "path_from_waypoints: ")
        return path_task

    follower = Follower(plant, tool, law, task, chosen)
    builder.AddSystem(follower)
    return follower
