"""A tool, its frame, its trail and the forces on it in Meshcat."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from pydrake.geometry import Cylinder, Meshcat, MeshcatCone, Rgba, Shape
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context, DiscreteValues, EventStatus, LeafSystem

AXIS_COLORS = (Rgba(0.85, 0.1, 0.1), Rgba(0.1, 0.65, 0.2), Rgba(0.1, 0.25, 0.9))
_AXIS_LENGTH, _AXIS_RADIUS = 0.08, 0.003


def draw_frame(meshcat: Meshcat, path: str) -> None:
    """Draw a frame at a path of the scene tree; its axes are red, green and blue.

    Args:
        meshcat: Meshcat instance.
        path: Meshcat path of the frame, which can then be moved.
    """
    for i, color in enumerate(AXIS_COLORS):
        direction = np.eye(3)[i]
        X_FA = RigidTransform(
            RotationMatrix.MakeFromOneVector(direction, 2), direction * _AXIS_LENGTH / 2
        )
        axis = f"{path}/axis_{i}"
        meshcat.SetObject(axis, Cylinder(_AXIS_RADIUS, _AXIS_LENGTH), color)
        meshcat.SetTransform(axis, X_FA)


_WIDTH = 4.0


class TrailVisualizer(LeafSystem):
    """Draws the past path of a point, piece by piece.

    Frames carry the time, so that a recording in progress contains them.

    Ports:
        point (input): World axes [m], shape (3,); nothing is drawn where it is not finite.
        value (input): Value shown by the colour, shape (1,), if any.

    State:
        Discrete: the point at the last frame [m], shape (3,), NaN before the first, and the
        number of frames, shape (1,).

    Args:
        name: Meshcat path of the trail.
        color: Its colour, or the colour of a piece as a function of the value at its end.
        meshcat: Meshcat instance, axes of the world.
        period: Time between frames [s].
        longest: Largest number of pieces; all of them by default.
    """

    def __init__(
        self,
        name: str,
        color: Rgba | Callable[[float], Rgba],
        meshcat: Meshcat,
        period: float,
        longest: int | None = None,
    ) -> None:
        super().__init__()
        self._longest = longest
        self._name, self._color, self._meshcat = name, color, meshcat
        self._last = self.DeclareDiscreteState(np.full(3, np.nan))
        self._frames = self.DeclareDiscreteState(1)
        self._point = self.DeclareVectorInputPort("point", 3)
        if not isinstance(color, Rgba):
            self.DeclareVectorInputPort("value", 1)
        self.DeclarePeriodicPublishEvent(period, 0.0, self._draw)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._remember)

    def _draw(self, context: Context) -> None:
        ends = np.column_stack(
            [context.get_discrete_state(self._last).value(), self._point.Eval(context)]
        )
        if not np.isfinite(ends).all():
            return
        time = context.get_time()
        frame = int(context.get_discrete_state(self._frames).value()[0])
        if self._longest is not None:
            frame %= self._longest
        piece = f"{self._name}/trail/{frame:05d}"
        self._meshcat.SetLine(piece, ends, _WIDTH, self._piece_color(context))
        if time > 0.0:
            self._meshcat.SetProperty(piece, "visible", False, 0.0)
        self._meshcat.SetProperty(piece, "visible", True, time)

    def _piece_color(self, context: Context) -> Rgba:
        if isinstance(self._color, Rgba):
            return self._color
        return self._color(float(self.GetInputPort("value").Eval(context)[0]))

    def _remember(self, context: Context, state: DiscreteValues) -> None:
        state.set_value(self._last, self._point.Eval(context))
        frames = context.get_discrete_state(self._frames).value()
        state.set_value(self._frames, frames + 1)


@dataclass(frozen=True, eq=False)
class ToolPart:
    """A drawn part that moves with the tool.

    Attributes:
        name: Name, unique among the parts.
        shape: Shape.
        color: Its colour.
        X_TP: Pose of the part's frame P in the tool's.
    """

    name: str
    shape: Shape
    color: Rgba
    X_TP: RigidTransform = field(default_factory=RigidTransform)


class ToolVisualizer(LeafSystem):
    """Draws parts that move with the tool.

    Frames carry the time, so that a recording in progress contains them.

    Ports:
        tool_pose (input): ``[y_t, R_e]``, shape (12,), with ``R_e`` row by row.

    Args:
        parts: Parts to draw.
        meshcat: Meshcat instance, axes of the inertial frame.
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
        # interpolated between two frames, hence not exactly a rotation
        R_WT = RotationMatrix.ProjectToRotationMatrix(pose[3:].reshape(3, 3))
        self._meshcat.SetTransform(self._root, RigidTransform(R_WT, pose[:3]), context.get_time())


FORCE_COLOR = Rgba(0.95, 0.65, 0.05, 1.0)
_LENGTH = 0.25  # m, of the largest force
_RADIUS, _HEAD_RADIUS, _HEAD_LENGTH = 0.008, 0.022, 0.06  # m
_AWAY = 0.08  # m, of the tip from the point, which may be inside a link
_LEAST = 0.02  # of the largest force; smaller forces are not drawn


class ForceArrows(LeafSystem):
    """Draws forces as arrows that point at where they act, longer for larger forces.

    Frames carry the time, so that a recording in progress contains them.

    Ports:
        points (input): Points of application of K forces, world axes [m], shape (3K,).
        forces (input): Forces, world axes [N], shape (3K,).

    Args:
        count: Number K of forces.
        largest: Force whose arrow is the longest [N].
        meshcat: Meshcat instance, axes of the world.
        period: Time between frames [s].
        root: Meshcat path of the arrows.
    """

    def __init__(
        self, count: int, largest: float, meshcat: Meshcat, period: float, root: str = "push"
    ) -> None:
        super().__init__()
        self._largest, self._meshcat = largest, meshcat
        self._arrows = [f"{root}/{k + 1}" for k in range(count)]
        self._points = self.DeclareVectorInputPort("points", 3 * count)
        self._forces = self.DeclareVectorInputPort("forces", 3 * count)
        self.DeclareInitializationPublishEvent(self._draw_parts)
        self.DeclarePeriodicPublishEvent(period, 0.0, self._draw)

    def _draw_parts(self, context: Context) -> EventStatus:
        """Draw heads before the origins, pointing along z, with shafts of length 1 behind them."""
        for arrow in self._arrows:
            head, shaft = f"{arrow}/head", f"{arrow}/shaft/cylinder"
            # a cone stands on its tip
            self._meshcat.SetObject(
                head, MeshcatCone(_HEAD_LENGTH, _HEAD_RADIUS, _HEAD_RADIUS), FORCE_COLOR
            )
            turned = RotationMatrix.MakeXRotation(np.pi)
            self._meshcat.SetTransform(head, RigidTransform(turned, [0.0, 0.0, -_AWAY]))
            self._meshcat.SetObject(shaft, Cylinder(_RADIUS, 1.0), FORCE_COLOR)
            self._meshcat.SetTransform(shaft, RigidTransform([0.0, 0.0, -0.5]))
            behind = RigidTransform([0.0, 0.0, -_AWAY - _HEAD_LENGTH])
            self._meshcat.SetTransform(f"{arrow}/shaft", behind)
        self._draw(context)
        return EventStatus.Succeeded()

    def _draw(self, context: Context) -> None:
        time = context.get_time()
        points = self._points.Eval(context).reshape(-1, 3)
        forces = self._forces.Eval(context).reshape(-1, 3)
        for arrow, point, force in zip(self._arrows, points, forces, strict=True):
            size = float(np.linalg.norm(force))
            is_visible = bool(np.isfinite(size + point.sum()) and size > _LEAST * self._largest)
            self._meshcat.SetProperty(arrow, "visible", is_visible, time)
            if not is_visible:
                continue
            R_WA = RotationMatrix.MakeFromOneVector(force, 2)
            self._meshcat.SetTransform(arrow, RigidTransform(R_WA, point), time)
            length = _LENGTH * size / self._largest
            self._meshcat.SetProperty(f"{arrow}/shaft", "scale", [1.0, 1.0, length], time)
