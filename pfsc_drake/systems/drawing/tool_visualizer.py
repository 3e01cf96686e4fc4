"""What a tool carries, in Meshcat."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from pydrake.geometry import Meshcat, Rgba, Shape
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context, EventStatus, LeafSystem


@dataclass(frozen=True, eq=False)
class ToolPart:
    """Something drawn that moves with the tool.

    Attributes:
        name: Name, of its own among the parts.
        shape: What it looks like.
        color: Its colour.
        X_TP: Pose of the part's frame P in the tool's.
    """

    name: str
    shape: Shape
    color: Rgba
    X_TP: RigidTransform = field(default_factory=RigidTransform)


class ToolVisualizer(LeafSystem):
    """Draws parts that move with the tool.

    Frames carry the time, so that a recording in progress gets them.

    Ports:
        tool_pose (input): ``[y_t, R_e]``, shape (12,), with ``R_e`` row by row.

    Args:
        parts: What to draw.
        meshcat: Where to draw, axes of the inertial frame.
        period: Time between frames [s].
        root: Path of all parts.
    """

    def __init__(
        self, parts: Sequence[ToolPart], meshcat: Meshcat, period: float, root: str = "tool"
    ) -> None:
        super().__init__()
        self._parts, self._meshcat, self._root = parts, meshcat, root
        self._tool_pose = self.DeclareVectorInputPort("tool_pose", 12)
        self.DeclareInitializationPublishEvent(self._draw_parts)
        self.DeclarePeriodicPublishEvent(period, 0.0, self._draw)

    def _draw_parts(self, context: Context) -> EventStatus:
        for part in self._parts:
            self._meshcat.SetObject(f"{self._root}/{part.name}", part.shape, part.color)
            self._meshcat.SetTransform(f"{self._root}/{part.name}", part.X_TP)
        self._draw(context)
        return EventStatus.Succeeded()

    def _draw(self, context: Context) -> None:
        pose = self._tool_pose.Eval(context)
        # interpolated between two frames, hence no rotation exactly
        R_WT = RotationMatrix.ProjectToRotationMatrix(pose[3:].reshape(3, 3))
        self._meshcat.SetTransform(self._root, RigidTransform(R_WT, pose[:3]), context.get_time())
