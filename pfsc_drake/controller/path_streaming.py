"""Following a path whose way points come while the tool moves, in one call."""

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
    """Add a controller that lets a tool follow way points that come while it moves.

    ::

        follower = add_path_streaming(builder, plant, "tcp", [0.9, 0.0, 0.8], law="rigid")
        sender = WaypointSender(follower.messages)
        sender.add([0.91, 0.01, 0.8])
        # at every tick, or whenever there is something new
        port.FixValue(context, sender.message)

    Its ports are those of :func:`~pfsc_drake.add_path_following` but for ``override``, and

    - waypoints (input): a message of the last way points, see
      :class:`~pfsc_drake.control.streams.messages.WaypointLayout`;
    - stream (output): ``[status, taken, way left, largest speed]``, shape (4,), see
      :class:`~pfsc_drake.control.streams.intake.WaypointIntake`.

    Args:
        builder: Builder of the diagram.
        plant: The robot, finalized, as the controller believes it.
        tool: Name of the frame whose origin follows the path, with its orientation if way points
            have one.
        start: Where the tool rests before the first way point: position [m], shape (3,), or with
            a quaternion (w, x, y, z), shape (7,), where way points have one.
        law: ``velocity_servo``, ``rigid``, ``singular_perturbation``, ``visco_elastic`` or
            ``elastic``.
        stream: How way points become a path, and how fast it is followed.
        options: What else is chosen.

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
