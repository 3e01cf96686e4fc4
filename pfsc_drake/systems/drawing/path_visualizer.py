"""Path, moving frame and trail of the tool in Meshcat."""

import numpy as np
from pydrake.geometry import Cylinder, Meshcat, Rgba
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context, DiscreteValues, EventStatus, LeafSystem

from pfsc_drake.geometry import Path, PathPointLayout

_ROOT = "path_following"
_PATH_COLOR = Rgba(0.15, 0.4, 0.85, 1.0)
_TRAIL_COLOR = Rgba(0.9, 0.25, 0.1, 1.0)
_AXIS_COLORS = (Rgba(0.85, 0.1, 0.1), Rgba(0.1, 0.65, 0.2), Rgba(0.1, 0.25, 0.9))
_AXIS_LENGTH, _AXIS_RADIUS = 0.08, 0.003


class PathVisualizer(LeafSystem):
    """Draws the path, the parallel transport frame at the projected point, and the tool's trail.

    The frame's axes are red ``e_par``, green ``e_perp``, blue ``e_cross``.

    Ports:
        tool_pose (input): ``[y_t, R_e]``, shape (12,).
        path_point (input): From :class:`PathProjector`.

    State:
        Discrete: tool point at the last frame [m], shape (3,), and their number, shape (1,).

    Args:
        path: The path.
        layout: Layout of the path point.
        meshcat: Where to draw.
        period: Time between frames [s].
    """

    def __init__(
        self, path: Path, layout: PathPointLayout, meshcat: Meshcat, period: float
    ) -> None:
        super().__init__()
        self._path, self._layout, self._meshcat = path, layout, meshcat
        self._last = self.DeclareDiscreteState(np.full(3, np.nan))
        self._frames = self.DeclareDiscreteState(1)
        self._tool_pose = self.DeclareVectorInputPort("tool_pose", 12)
        self._path_point = self.DeclareVectorInputPort("path_point", layout.size)
        self.DeclareInitializationPublishEvent(self._draw_path)
        self.DeclarePeriodicPublishEvent(period, 0.0, self._draw)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._remember)

    def _draw_path(self, context: Context) -> EventStatus:
        theta = np.linspace(*self._path.position.domain, 800)
        points = self._path.position.derivatives(theta, 0)[:, 0, :]
        self._meshcat.SetLine(f"{_ROOT}/path", points.T, 3.0, _PATH_COLOR)
        for i, color in enumerate(_AXIS_COLORS):
            direction = np.eye(3)[i]
            X_FA = RigidTransform(
                RotationMatrix.MakeFromOneVector(direction, 2), direction * _AXIS_LENGTH / 2
            )
            axis = f"{_ROOT}/frame/axis_{i}"
            self._meshcat.SetObject(axis, Cylinder(_AXIS_RADIUS, _AXIS_LENGTH), color)
            self._meshcat.SetTransform(axis, X_FA)
        return EventStatus.Succeeded()

    def _draw(self, context: Context) -> None:
        point = self._path_point.Eval(context)
        if not np.isfinite(point).all():
            return
        time = context.get_time()
        position = point[self._layout.position]
        e_par = position[3:6] / np.linalg.norm(position[3:6])
        e_perp = point[self._layout.normal]
        R_WF = RotationMatrix(np.column_stack([e_par, e_perp, np.cross(e_par, e_perp)]))
        self._meshcat.SetTransform(f"{_ROOT}/frame", RigidTransform(R_WF, position[:3]), time)
        last = context.get_discrete_state(self._last).value()
        if not np.isnan(last[0]):
            self._extend_trail(context, last, time)

    def _extend_trail(self, context: Context, last: np.ndarray, time: float) -> None:
        y_t = self._tool_pose.Eval(context)[:3]
        frame = int(context.get_discrete_state(self._frames).value()[0])
        piece = f"{_ROOT}/trail/{frame:05d}"
        self._meshcat.SetLine(piece, np.column_stack([last, y_t]), 4.0, _TRAIL_COLOR)
        if time > 0.0:
            self._meshcat.SetProperty(piece, "visible", False, 0.0)
        self._meshcat.SetProperty(piece, "visible", True, time)

    def _remember(self, context: Context, state: DiscreteValues) -> None:
        state.set_value(self._last, self._tool_pose.Eval(context)[:3])
        frames = context.get_discrete_state(self._frames).value()
        state.set_value(self._frames, frames + 1)
