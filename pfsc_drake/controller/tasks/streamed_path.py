"""A path whose way points come while the tool moves, and the systems that make it."""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort

from pfsc_drake.blocks.block import Values
from pfsc_drake.control.law.pace import PacedReference
from pfsc_drake.control.streams.intake import WaypointIntake
from pfsc_drake.control.streams.messages import WaypointLayout
from pfsc_drake.control.streams.projector import StreamedProjector
from pfsc_drake.control.streams.stream_course import POSE, POSITION, Course
from pfsc_drake.control.streams.stream_parameters import StreamParameters
from pfsc_drake.errors import require
from pfsc_drake.geometry import quaternion_to_matrix
from pfsc_drake.robot.inverse_kinematics import ToolTarget
from pfsc_drake.systems.block_system import BlockSystem

_NO_SIZE = 1e-6


class StreamedPath:
    """A path of which only the begin is known beforehand.

    Args:
        start: Where the tool rests at first: position [m], and quaternion (w, x, y, z) where way
            points have one, shape (3,) or (7,).
        parameters: How way points become a path.
        order: Relative degree r of the law.
        direction: Direction of the path before its first way point, shape (3,).
        length: How many way points a message holds.

    Attributes:
        course: Layout of the path.
        parameters: How way points become a path.
        messages: Layout of messages.
        start: Where the tool rests at first, the quaternion of length one.

    Raises:
        InputError: If the start is no place.
    """

    def __init__(
        self,
        start: ArrayLike,
        parameters: StreamParameters,
        order: int,
        *,
        direction: ArrayLike = (1.0, 0.0, 0.0),
        length: int = 32,
    ) -> None:
        self.start = np.array(start, dtype=float)
        good = self.start.shape in ((POSITION,), (POSE,)) and bool(np.isfinite(self.start).all())
        require(good, "start", np.round(self.start, 6).tolist(), "3 or 7 finite numbers")
        if len(self.start) == POSE:
            size = np.linalg.norm(self.start[POSITION:])
            require(
                bool(size > _NO_SIZE), "start", self.start.tolist(), "a quaternion that is not zero"
            )
            self.start[POSITION:] /= size
        self.course = Course(order, len(self.start), parameters.columns)
        self.parameters, self._direction = parameters, direction
        self.messages = WaypointLayout(len(self.start), length)

    def __content__(self) -> object:
        """Return what decides over it."""
        return self.start, self.parameters, self.course, self._direction, self.messages.length

    @property
    def is_oriented(self) -> bool:
        """Whether way points have an orientation."""
        return len(self.start) == POSE

    @property
    def projector(self) -> StreamedProjector:
        """What finds the tool's place on it."""
        return StreamedProjector(self.course)

    @property
    def target(self) -> ToolTarget:
        """Where the tool is at the start."""
        R_e = quaternion_to_matrix(self.start[POSITION:]) if self.is_oriented else None
        return ToolTarget(self.start[:POSITION], R_e)

    def intake(self, highest: int, period: float) -> WaypointIntake:
        """Return what takes way points.

        Args:
            highest: Order of the highest derivative of the reference.
            period: Sampling time [s].
        """
        return WaypointIntake(
            self.course,
            self.parameters,
            self.messages,
            highest,
            period,
            at_rest=self.start,
            direction=self._direction,
        )

    @cached_property
    def point(self) -> np.ndarray:
        """The path's point at the start, laid out by the manifold's layout, shape (size,)."""
        projector, intake = self.projector, self.intake(1, 1.0)
        course = intake.initial(Values(), 0)["course"]
        pose = np.concatenate([self.start[:POSITION], np.eye(3).ravel()])
        u = Values(tool_pose=ca.DM(pose), course=course)
        x = Values(**projector.initial(u, 0))
        return np.array(projector.output(x, u, 0)["manifold_point"]).ravel()


@dataclass(frozen=True)
class Stream:
    """Systems that make a path of way points, connected.

    Attributes:
        waypoints: Port for messages.
        reference: Derivatives of the virtual output's reference by rows.
        stream: Status of the stream, see :class:`WaypointIntake`.
        course: The path, laid out by :class:`Course`.
    """

    waypoints: InputPort
    reference: OutputPort
    stream: OutputPort
    course: OutputPort


def add_stream(
    builder: DiagramBuilder,
    path: StreamedPath,
    projector: BlockSystem,
    order: int,
    num_outputs: int,
    period: float,
) -> Stream:
    """Add what takes way points and what goes along the path that they make.

    Args:
        builder: Builder of the diagram.
        path: The path.
        projector: Finds the tool's place on it; its port for the course is connected.
        order: Order of the highest derivative of the reference.
        num_outputs: m.
        period: Sampling time [s].
    """
    intake = builder.AddNamedSystem(
        "waypoint_intake", BlockSystem(path.intake(order, period), period)
    )
    paced = PacedReference(
        path.parameters.limits, order, num_outputs, period, stretches=path.course.spans
    )
    pace = builder.AddNamedSystem("paced_reference", BlockSystem(paced, period))
    course = intake.GetOutputPort("course")
    builder.Connect(course, projector.GetInputPort("course"))
    builder.Connect(
        projector.GetOutputPort("manifold_point"), intake.GetInputPort("manifold_point")
    )
    for name in ("motion", "stop"):
        builder.Connect(pace.GetOutputPort(name), intake.GetInputPort(name))
    for name in ("goal", "stretches", "stretch_speeds"):
        builder.Connect(intake.GetOutputPort(name), pace.GetInputPort(name))
    return Stream(
        intake.GetInputPort("waypoints"),
        pace.GetOutputPort("reference"),
        intake.GetOutputPort("stream"),
        course,
    )
