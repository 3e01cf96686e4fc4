"""Path and moving frame in Meshcat."""

import numpy as np
from pydrake.geometry import Meshcat, Rgba
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context, EventStatus, LeafSystem

from pfsc_drake.geometry import Path, PathPointLayout
from pfsc_drake.systems.drawing.tool_visualizer import draw_frame

_ROOT = "path_following"
_PATH_COLOR = Rgba(0.15, 0.4, 0.85, 1.0)


class PathVisualizer(LeafSystem):
    """Draws the path, and the parallel transport frame at the projected point.

    The frame's axes are red ``e_par``, green ``e_perp``, blue ``e_cross``.

    Ports:
        path_point (input): From :class:`Projector`.

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
        self._path_point = self.DeclareVectorInputPort("path_point", layout.size)
        self.DeclareInitializationPublishEvent(self._draw_path)
        self.DeclarePeriodicPublishEvent(period, 0.0, self._draw)

    def _draw_path(self, context: Context) -> EventStatus:
        theta = np.linspace(*self._path.position.domain, 800)
        points = self._path.position.derivatives(theta, 0)[:, 0, :]
        self._meshcat.SetLine(f"{_ROOT}/path", points.T, 3.0, _PATH_COLOR)
        draw_frame(self._meshcat, f"{_ROOT}/frame")
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
