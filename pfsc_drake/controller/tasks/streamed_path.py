"""Path through waypoints that are received while the tool moves, and its systems."""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort

from pfsc_drake.blocks.block import Values
from pfsc_drake.control.law.paced_reference import PacedReference
from pfsc_drake.control.streams.growing_path import POSE, POSITION, GrowingPath
from pfsc_drake.control.streams.intake import WaypointIntake
from pfsc_drake.control.streams.messages import WaypointLayout
from pfsc_drake.control.streams.projector import StreamedProjector
from pfsc_drake.control.streams.stream_parameters import StreamParameters
from pfsc_drake.errors import require
from pfsc_drake.geometry import quaternion_to_matrix
from pfsc_drake.robot.inverse_kinematics import ToolTarget
from pfsc_drake.systems.block_system import BlockSystem

_NO_SIZE = 1e-6


class StreamedPath:
    """Path that grows by received waypoints; only its begin is known beforehand.

    Args:
        start: Pose of the tool at rest: position [m], and quaternion (w, x, y, z) if waypoints have
            one, shape (3,) or (7,).
        parameters: Parameters of the path through waypoints.
        order: Relative degree r of the law.
        direction: Direction of the path before its first waypoint, shape (3,).
        length: Number of waypoints in a message.

    Attributes:
        layout: Layout of the path.
        parameters: Parameters of the path through waypoints.
        messages: Layout of messages.
        start: Pose of the tool at rest, with unit quaternion.

    Raises:
        InputError: If the start is not a pose.
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
        self.layout = GrowingPath(order, len(self.start), parameters.columns)
        self.parameters, self._direction = parameters, direction
        self.messages = WaypointLayout(len(self.start), length)

    def __content__(self) -> object:
        """Return the data that determine the path."""
        return self.start, self.parameters, self.layout, self._direction, self.messages.length

    @property
    def is_oriented(self) -> bool:
        """Whether waypoints have an orientation."""
        return len(self.start) == POSE

    @property
    def projector(self) -> StreamedProjector:
        """Block that finds the closest point on the path."""
        return StreamedProjector(self.layout)

    @property
    def target(self) -> ToolTarget:
        """Pose of the tool at the start."""
        R_e = quaternion_to_matrix(self.start[POSITION:]) if self.is_oriented else None
        return ToolTarget(self.start[:POSITION], R_e)

    def intake(self, highest: int, period: float) -> WaypointIntake:
        """Return the block that receives waypoints.

        Args:
            highest: Order of the highest derivative of the reference.
            period: Sampling time [s].
        """
        return WaypointIntake(
            self.layout,
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
        path = intake.initial(Values(), 0)["path"]
        pose = np.concatenate([self.start[:POSITION], np.eye(3).ravel()])
        u = Values(tool_pose=ca.DM(pose), path=path)
        x = Values(**projector.initial(u, 0))
        return np.array(projector.output(x, u, 0)["manifold_point"]).ravel()


@dataclass(frozen=True)
class Stream:
    """Connected systems of a streamed path.

    Attributes:
        waypoints: Port for messages.
        reference: Derivatives of the virtual output's reference by rows.
        stream: Status of the stream, see :class:`WaypointIntake`.
        path: The path, laid out by :class:`GrowingPath`.
    """

    waypoints: InputPort
    reference: OutputPort
    stream: OutputPort
    path: OutputPort


def add_stream(
    builder: DiagramBuilder,
    path: StreamedPath,
    projector: BlockSystem,
    order: int,
    num_outputs: int,
    period: float,
) -> Stream:
    """Add the intake of waypoints and the reference along their path.

    Args:
        builder: Builder of the diagram.
        path: The path.
        projector: System that finds the closest point; its port for the path is connected.
        order: Order of the highest derivative of the reference.
        num_outputs: m.
        period: Sampling time [s].
    """
    intake = builder.AddNamedSystem(
        "waypoint_intake", BlockSystem(path.intake(order, period), period)
    )
    paced = PacedReference(
        path.parameters.limits, order, num_outputs, period, stretches=path.layout.spans
    )
    reference = builder.AddNamedSystem("paced_reference", BlockSystem(paced, period))
    growing_path = intake.GetOutputPort("path")
    builder.Connect(growing_path, projector.GetInputPort("path"))
    builder.Connect(
        projector.GetOutputPort("manifold_point"), intake.GetInputPort("manifold_point")
    )
    for name in ("motion", "stop"):
        builder.Connect(reference.GetOutputPort(name), intake.GetInputPort(name))
    for name in ("goal", "stretches", "stretch_speeds"):
        builder.Connect(intake.GetOutputPort(name), reference.GetInputPort(name))
    return Stream(
        intake.GetInputPort("waypoints"),
        reference.GetOutputPort("reference"),
        intake.GetOutputPort("stream"),
        growing_path,
    )
