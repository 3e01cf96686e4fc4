"""Following of a path through waypoints that are received during the motion, in one call."""

import numpy as np
from numpy.typing import ArrayLike
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from pfsc_drake.control.streams.stream_parameters import StreamParameters
from pfsc_drake.controller.follower import Follower
from pfsc_drake.controller.options.follower_options import FollowerOptions
from pfsc_drake.controller.tasks.stream_task import StreamTask
from pfsc_drake.controller.tasks.streamed_path import StreamedPath
from pfsc_drake.robot.robot_model import RobotModel


def add_path_streaming(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    tool: str,
    start: ArrayLike,
    law: str = "elastic",
    *,
    stream: StreamParameters | None = None,
    options: FollowerOptions | None = None,
) -> Follower:
    """Add a controller that lets a tool follow waypoints that are received during the motion.

    ::

        follower = add_path_streaming(builder, plant, "tcp", [0.9, 0.0, 0.8], law="rigid")
        sender = WaypointSender(follower.messages)
        sender.add([0.91, 0.01, 0.8])
        # at every sample, or for every new message
        port.FixValue(context, sender.message)

    Its ports are the ports of :func:`~pfsc_drake.add_path_following` except ``override``, and

    - waypoints (input): a message with the last waypoints, see
      :class:`~pfsc_drake.control.streams.messages.WaypointLayout`;
    - stream (output): ``[status, accepted, remaining length, largest speed]``, shape (4,), see
      :class:`~pfsc_drake.control.streams.intake.WaypointIntake`.

    Args:
        builder: Builder of the diagram.
        plant: The robot, finalized: its nominal model.
        tool: Name of the frame whose origin follows the path, with its orientation if waypoints
            have one.
        start: Pose of the tool at rest before the first waypoint: position [m], shape (3,), or with
            a quaternion (w, x, y, z), shape (7,), if waypoints have one.
        law: ``velocity_servo``, ``rigid``, ``singular_perturbation``, ``visco_elastic`` or
            ``elastic``.
        stream: Parameters of the path through waypoints, and of the motion along it.
        options: Further options.

    Returns:
        The controller, one diagram with the ports of :class:`Follower`.

    Raises:
        InputError: If robot, start, law and options do not go together, or the start is out of
            reach.
    """

    def task(robot: RobotModel, posture: np.ndarray, relative_degree: int) -> StreamTask:
        return StreamTask(StreamedPath(start, stream or StreamParameters(), relative_degree))

    follower = Follower(plant, tool, law, task, options or FollowerOptions())
    builder.AddSystem(follower)
    return follower
