"""Path following along waypoints that come while the tool moves."""

from collections.abc import Iterator
from pathlib import Path as FilePath

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.scenario import ControllerParameters, PathParameters, StartParameters, Streamed
from diagrams.scenario.streamed import DrawnPlane
from diagrams.tasks.arrivals import Event, read_arrivals, read_drawn, strokes, waypoint_messages
from diagrams.tasks.drawn_plane import SIDE, border
from diagrams.tasks.task_geometry import followed_angles
from pfsc_drake.checks import require
from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.control.manifolds.manifold import ToolKinematics
from pfsc_drake.control.streams.growing_path import POSE, POSITION
from pfsc_drake.controller.tasks.stream_task import StreamTask
from pfsc_drake.controller.tasks.streamed_path import StreamedPath
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import zyx_to_quaternion
from pfsc_drake.physics.waypoint_source import Arrivals, WaypointSource
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.physics.operator_panel import OperatorPanel, RecordedPen

_SETTLES = 3.0  # s, after the last waypoint, of a run without a duration
_SLOWEST = 0.3  # of the largest speed, for the duration of a run


class ScenarioStream(StreamTask):
    """Path following along the waypoints of a scenario.

    Attributes:
        arrivals: Times at which waypoints come; None where a person draws them.
        drawn: Drawing of a person, of a session that is repeated.
        plane: Plane in which a person draws, if one does.
        period: Sampling time [s].
    """

    arrivals: Arrivals | None = None
    drawn: list[Event] | None = None
    plane: DrawnPlane | None = None
    period: float

    def drawn_lines(self) -> list[np.ndarray]:
        """Return lines through the coming waypoints, or the border of the plane [m]."""
        if self.plane is not None:
            return [border(self.plane), *strokes(self.drawn or [])]
        assert self.arrivals is not None
        rows = np.vstack([[*self.path.start, 0.0], self.arrivals.rows])
        breaks = np.flatnonzero(rows[:, -1] > 0.0)
        return [part[:, :POSITION] for part in np.split(rows, breaks) if len(part) > 1]

    def add_source(
        self, builder: DiagramBuilder, stream: OutputPort, period: float
    ) -> tuple[OutputPort, OperatorPanel | None]:
        """Add the source of waypoints.

        Args:
            builder: Builder of the diagram.
            stream: Status of the stream.
            period: Sampling time [s].

        Returns:
            Messages with waypoints; the panel for those of a person who draws, port ``controls``,
            or None.
        """
        messages = self.path.messages
        if self.arrivals is not None:
            block = WaypointSource(self.arrivals, messages)
            source = builder.AddNamedSystem("waypoint_source", BlockSystem(block, period))
            return source.GetOutputPort("waypoints"), None
        parts = {"waypoints": np.zeros(messages.size)}
        panel = builder.AddNamedSystem("pen_panel", OperatorPanel(parts, period))
        if self.drawn is not None:
            recorded = waypoint_messages(self.drawn, messages)
            pen = RecordedPen(*recorded, messages.length, period)
            player = builder.AddNamedSystem("recorded_pen", pen)
            builder.Connect(stream, player.get_input_port())
            builder.Connect(player.get_output_port(), panel.GetInputPort("controls"))
        return panel.GetOutputPort("waypoints"), panel

    def add_actual_projection(
        self,
        builder: DiagramBuilder,
        robot: RobotModel,
        joint_state: OutputPort,
        path: OutputPort,
        period: float,
    ) -> OutputPort:
        """Add the projection of the actual tool onto the path, for the log.

        Args:
            builder: Builder of the diagram.
            robot: The simulated robot.
            joint_state: Its actual state.
            path: The path, laid out by :class:`GrowingPath`.
            period: Sampling time [s].
        """
        tool = builder.AddNamedSystem("true_tool", BlockSystem(ToolKinematics(robot), period))
        builder.Connect(joint_state, tool.GetInputPort("joint_state"))
        block = BlockSystem(self.path.projector, period)
        projection = builder.AddNamedSystem("actual_projection", block)
        builder.Connect(tool.GetOutputPort("tool_pose"), projection.GetInputPort("tool_pose"))
        builder.Connect(path, projection.GetInputPort("path"))
        return projection.GetOutputPort("manifold_point")

    def tool_positions(self) -> Iterator[tuple[np.ndarray, str]]:
        """Yield positions of the tool along its motion [m], each (3,), with their names."""
        if self.plane is not None:
            for corner in border(self.plane)[::SIDE]:
                yield corner, "plane to draw in"
            return
        assert self.arrivals is not None
        for k, row in enumerate(self.arrivals.rows, start=1):
            yield row[:POSITION], f"waypoint {k}"


def stream_task(
    parameters: PathParameters,
    controller: ControllerParameters,
    start: StartParameters,
    duration: float,
    folder: FilePath,
) -> ScenarioStream:
    """Return the task of a scenario whose waypoints come while the tool moves.

    Args:
        parameters: The path; its shape is a stream.
        controller: The controller; its law decides how smooth the path is made.
        start: Start of the tool.
        duration: Simulated time [s]; 0 for as long as it may take.
        folder: Base folder of relative file names.

    Raises:
        InputError: If a file cannot be read, or the start is not at the begin of the path.
    """
    shape, orientation = parameters.shape, parameters.orientation
    period = controller.sampling_time
    assert isinstance(shape, Streamed)
    try:
        shape.check()
    except InputError as error:
        raise InputError(f"path.shape.{error}") from None
    keyframes = f"{len(orientation.keyframes)} given"
    require(not orientation.keyframes, "path.orientation.keyframes", keyframes, "none of a stream")
    arrivals, drawn, plane = None, None, shape.plane
    if plane is None:
        begin, arrivals = read_arrivals(shape, folder, period)
        ahead = arrivals.rows[0, :POSITION] - begin[:POSITION]
    else:
        begin, ahead = np.array(plane.origin), np.array(plane.right)
        if plane.zyx_deg:
            begin = np.concatenate([begin, zyx_to_quaternion(np.deg2rad(plane.zyx_deg))])
    if orientation.task == "none":
        begin, arrivals = begin[:POSITION], without_orientation(arrivals)
    if shape.inputs:
        try:
            drawn = read_drawn(str(folder / shape.inputs), len(begin), period)
        except InputError as error:
            raise InputError(f"path.shape.inputs: {error}") from None
    require(any(ahead), "path.shape.file", shape.file, "waypoints that differ")
    order = RELATIVE_DEGREE[controller.law]
    path = StreamedPath(begin, shape.follow, order, direction=ahead, length=shape.length)
    task = ScenarioStream(
        path,
        followed_angles(orientation),
        rotation_deg=start.rotation_deg,
        duration=duration or _longest(path, arrivals, shape, period),
    )
    task.arrivals, task.drawn, task.plane, task.period = arrivals, drawn, plane, period
    on_path = not any(start.offset)
    require(on_path, "start.offset", start.offset, "0 where waypoints come while it moves")
    return task


def _longest(
    path: StreamedPath, arrivals: Arrivals | None, shape: Streamed, period: float
) -> float:
    """Return the duration of a run [s]."""
    if arrivals is None:
        raise InputError("duration = 0: must be a positive number [s] where a person draws")
    points = np.vstack([path.start, arrivals.rows[:, :-1]])[:, :POSITION]
    distance = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    come = arrivals.ends * period
    return float(np.ceil(max(come, distance / (_SLOWEST * shape.follow.velocity)) + _SETTLES))


def without_orientation(arrivals: Arrivals | None) -> Arrivals | None:
    """Return arrivals of positions alone."""
    if arrivals is None or arrivals.rows.shape[1] <= POSE:
        return arrivals
    rows = np.column_stack([arrivals.rows[:, :POSITION], arrivals.rows[:, -1]])
    return Arrivals(arrivals.ticks, rows, arrivals.ends)
