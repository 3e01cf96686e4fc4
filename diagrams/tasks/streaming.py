"""Following a path whose way points come while the tool moves."""

from collections.abc import Iterator
from pathlib import Path as FilePath

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.scenario import ControllerParameters, PathParameters, StartParameters, Streamed
from diagrams.scenario.checks import require
from diagrams.tasks.arrivals import Event, made_arrivals, read_drawn, strokes, told_messages
from diagrams.tasks.drawn_plane import SIDE, StreamDrawing, border
from diagrams.tasks.task import StartPoint, Task
from diagrams.tasks.task_geometry import followed_angles
from pfsc_drake.blocks.block import Block
from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.control.manifolds.manifold import PlaceEvaluator, ToolKinematics
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.control.streams.course import POSE, POSITION
from pfsc_drake.errors import InputError
from pfsc_drake.following.streamed_path import Stream, StreamedPath
from pfsc_drake.geometry import PiecewisePolynomialCurve, zyx_to_quaternion
from pfsc_drake.physics.hand_way import Place
from pfsc_drake.physics.waypoint_source import Arrivals, WaypointSource
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.physics.operator_panel import OperatorPanel
from pfsc_drake.systems.physics.recorded_pen import RecordedPen

_SETTLES = 3.0  # s, after the last way point has come, of a run that tells no duration
_SLOWEST = 0.3  # of the largest speed, to tell how long a run may take


class StreamTask(Task):
    """Path following along way points that come while the tool moves.

    Args:
        parameters: The path; its shape is a stream.
        controller: The controller; its law decides how smooth the path is made.
        start: Where the tool starts.
        duration: Simulated time [s]; 0 for as long as it may take.
        folder: Where relative file names start.

    Attributes:
        path: The path.
        arrivals: When way points come; None where a person draws them.
        drawn: What a person has drawn, of a session that is repeated.
        plane: Where a person draws, if one does.

    Raises:
        InputError: If a file cannot be read, or the start is not where the path begins.
    """

    projector_name = "path_projector"
    place: PathManifold
    shape = None

    def __init__(
        self,
        parameters: PathParameters,
        controller: ControllerParameters,
        start: StartParameters,
        duration: float,
        folder: FilePath,
    ) -> None:
        shape, said = parameters.shape, parameters.orientation
        assert isinstance(shape, Streamed)
        try:
            shape.check()
        except InputError as error:
            raise InputError(f"path.shape.{error}") from None
        keyframes = f"{len(said.keyframes)} given"
        require(not said.keyframes, "path.orientation.keyframes", keyframes, "none of a stream")
        period, order = controller.sampling_time, RELATIVE_DEGREE[controller.law]
        self.plane, self.period = shape.plane, period
        self.arrivals: Arrivals | None = None
        self.drawn: list[Event] | None = None
        if shape.plane is None:
            begin, self.arrivals = made_arrivals(shape, folder, period)
            ahead = self.arrivals.rows[0, :POSITION] - begin[:POSITION]
        else:
            begin = np.array(shape.plane.origin)
            if shape.plane.zyx_deg:
                q = zyx_to_quaternion(np.deg2rad(shape.plane.zyx_deg))
                begin = np.concatenate([begin, q])
            ahead = np.array(shape.plane.right)
        if said.task == "none":
            begin = begin[:POSITION]
            self.arrivals = without_orientation(self.arrivals)
        if shape.inputs:
            try:
                self.drawn = read_drawn(str(folder / shape.inputs), len(begin), period)
            except InputError as error:
                raise InputError(f"path.shape.inputs: {error}") from None
        require(any(ahead), "path.shape.file", shape.file, "way points that differ")
        self.path = StreamedPath(begin, shape.follow, order, direction=ahead, length=shape.length)
        angles = followed_angles(said)
        self.place = PathManifold(order, oriented=self.path.is_oriented, **angles)
        self.manifold, self._start, self.warnings = self.place, start, []
        self.streamed = self.path
        self._duration = duration or self._longest(shape)
        self.motion = PiecewisePolynomialCurve([0.0, self._duration], np.zeros((1, 1, 1)))
        placed = not any(start.offset)
        require(placed, "start.offset", start.offset, "0 where way points come while it moves")

    def _longest(self, shape: Streamed) -> float:
        """Return how long a run may take [s]."""
        if self.arrivals is None:
            raise InputError("duration = 0: must be a positive number [s] where a person draws")
        places = np.vstack([self.path.start, self.arrivals.rows[:, :-1]])[:, :POSITION]
        way = np.linalg.norm(np.diff(places, axis=0), axis=1).sum()
        come = self.arrivals.ends * self.period
        return float(np.ceil(max(come, way / (_SLOWEST * shape.follow.velocity)) + _SETTLES))

    @property
    def length(self) -> float:
        """Length of the manifold [m] if it is known; else 0."""
        return 0.0

    def require_joints(self, num_joints: int) -> None:
        """Refuse a robot that cannot follow, or would lose its orientation by oversight."""
        names = [coordinate.name for coordinate in self.place.coordinates]
        few = f"{num_joints} joints for {len(names)} outputs ({', '.join(names)})"
        require(num_joints >= len(names), "path", few, "path.orientation.task: tool_axis or none")

    def evaluate(self, y_t: np.ndarray, memory: np.ndarray) -> np.ndarray:
        """Return the point where the path begins: nobody knows the rest beforehand."""
        return self.path.point

    @property
    def evaluator(self) -> PlaceEvaluator:
        """What finds places; none, as the path is told tick by tick."""
        raise InputError("path.shape = !Streamed: its path is not known beforehand")

    @property
    def drawing(self) -> StreamDrawing:
        """How the manifold is drawn."""
        return StreamDrawing(self._lines(), self.place.layout)

    def _lines(self) -> list[np.ndarray]:
        """Return lines through the way points that will come, or the border of the plane [m]."""
        if self.plane is not None:
            return [border(self.plane), *strokes(self.drawn or [])]
        assert self.arrivals is not None
        rows = np.vstack([[*self.path.start, 0.0], self.arrivals.rows])
        breaks = np.flatnonzero(rows[:, -1] > 0.0)
        return [part[:, :POSITION] for part in np.split(rows, breaks) if len(part) > 1]

    @property
    def projecting(self) -> Block:
        """Block that finds the closest point on the path."""
        return self.path.projector

    def add_source(
        self, builder: DiagramBuilder, stream: Stream, period: float
    ) -> OperatorPanel | None:
        """Add what way points come from.

        Args:
            builder: Builder of the diagram.
            stream: What takes them.
            period: Sampling time [s].

        Returns:
            Where the messages of a person who draws enter, port ``controls``; None if nobody does.
        """
        messages = self.path.messages
        if self.arrivals is not None:
            block = WaypointSource(self.arrivals, messages)
            source = builder.AddNamedSystem("waypoint_source", BlockSystem(block, period))
            builder.Connect(source.GetOutputPort("waypoints"), stream.waypoints)
            return None
        parts = {"waypoints": np.zeros(messages.size)}
        panel = builder.AddNamedSystem("pen_panel", OperatorPanel(parts, period))
        builder.Connect(panel.GetOutputPort("waypoints"), stream.waypoints)
        if self.drawn is not None:
            told = told_messages(self.drawn, messages)
            pen = RecordedPen(*told, messages.length, period)
            player = builder.AddNamedSystem("recorded_pen", pen)
            builder.Connect(stream.stream, player.get_input_port())
            builder.Connect(player.get_output_port(), panel.GetInputPort("controls"))
        return panel

    def add_true_place(
        self,
        builder: DiagramBuilder,
        robot: RobotModel,
        joint_state: OutputPort,
        stream: Stream,
        period: float,
    ) -> OutputPort:
        """Add what finds where on the path the tool really is, for the log.

        Args:
            builder: Builder of the diagram.
            robot: The robot as it is.
            joint_state: Its state as it is.
            stream: What makes the path.
            period: Sampling time [s].
        """
        tool = builder.AddNamedSystem("true_tool", BlockSystem(ToolKinematics(robot), period))
        builder.Connect(joint_state, tool.GetInputPort("joint_state"))
        place = builder.AddNamedSystem("true_place", BlockSystem(self.path.projector, period))
        builder.Connect(tool.GetOutputPort("tool_pose"), place.GetInputPort("tool_pose"))
        builder.Connect(stream.course, place.GetInputPort("course"))
        return place.GetOutputPort("manifold_point")

    def start(self, shift: np.ndarray) -> StartPoint:
        """Return where the tool starts."""
        target, layout = self.path.target, self.place.layout
        posed = self._tool_target(target.y_t + shift, target.R_e, self._start.rotation_deg)
        return StartPoint(posed, self.path.point[layout.memory])

    def point(self, start: StartPoint) -> np.ndarray:
        """Return the point of the manifold that the law acts on at the start."""
        return self.path.point

    def way(self) -> Iterator[tuple[np.ndarray, str]]:
        """Yield positions along the way of the tool [m], each (3,), with what to call them."""
        if self.plane is not None:
            for corner in border(self.plane)[::SIDE]:
                yield corner, "plane to draw in"
            return
        assert self.arrivals is not None
        for k, row in enumerate(self.arrivals.rows, start=1):
            yield row[:POSITION], f"way point {k}"

    def target(self) -> Place:
        """Return where given coordinates of the manifold are in the world."""
        raise InputError("path.shape = !Streamed: no frame of it is known beforehand")

    def check_place(self, coordinates: np.ndarray, key: str) -> None:
        """Refuse coordinates off the manifold: none are known beforehand."""
        require(False, key, coordinates.tolist(), "none on a path whose way points come")


def without_orientation(arrivals: Arrivals | None) -> Arrivals | None:
    """Return arrivals of positions alone."""
    if arrivals is None or arrivals.rows.shape[1] <= POSE:
        return arrivals
    rows = np.column_stack([arrivals.rows[:, :POSITION], arrivals.rows[:, -1]])
    return Arrivals(arrivals.ticks, rows, arrivals.ends)
