"""Surface and moving frame in Meshcat."""

from collections.abc import Callable, Sequence

import numpy as np
from pydrake.geometry import Meshcat, Rgba
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context, EventStatus, LeafSystem

from pfsc_drake.systems.drawing.moving_frame import draw_frame

_ROOT = "surface_following"
_LINE, _SKIN = Rgba(0.15, 0.4, 0.85, 1.0), Rgba(0.45, 0.65, 0.95, 0.35)


class SurfaceVisualizer(LeafSystem):
    """Draws a surface, and its frame at the projected point.

    The frame's axes are red the first tangent, green the second across it, blue the normal.

    Ports:
        manifold_point (input): From the projector.

    Args:
        skin: Points of the surface on a grid [m], shape (rows, columns, 3).
        lines: Lines on it [m], each (points, 3).
        size: Of the manifold's point.
        place: ``point -> (position, axes)``, shapes (3,) and (3, 3).
        meshcat: Where to draw.
        period: Time between frames [s].
    """

    def __init__(
        self,
        skin: np.ndarray,
        lines: Sequence[np.ndarray],
        size: int,
        place: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
        meshcat: Meshcat,
        period: float,
    ) -> None:
        super().__init__()
        self._skin, self._lines, self._place, self._meshcat = skin, lines, place, meshcat
        self._point = self.DeclareVectorInputPort("manifold_point", size)
        self.DeclareInitializationPublishEvent(self._draw_surface)
        self.DeclarePeriodicPublishEvent(period, 0.0, self._draw)

    def _draw_surface(self, context: Context) -> EventStatus:
        draw_surface(self._meshcat, _ROOT, self._skin, self._lines)
        draw_frame(self._meshcat, f"{_ROOT}/frame")
        return EventStatus.Succeeded()

    def _draw(self, context: Context) -> None:
        point = self._point.Eval(context)
        if not np.isfinite(point).all():
            return
        position, axes = self._place(point)
        X_WF = RigidTransform(RotationMatrix.ProjectToRotationMatrix(axes), position)
        self._meshcat.SetTransform(f"{_ROOT}/frame", X_WF, context.get_time())


def draw_surface(
    meshcat: Meshcat, root: str, skin: np.ndarray, lines: Sequence[np.ndarray]
) -> None:
    """Draw a surface that one can see through.

    Args:
        meshcat: Where to draw.
        root: Meshcat path of what is drawn.
        skin: Points of the surface on a grid [m], shape (rows, columns, 3).
        lines: Lines on it [m], each (points, 3).
    """
    vertices, faces = _triangles(skin)
    both = np.vstack([faces, faces[:, ::-1]])
    meshcat.SetTriangleMesh(f"{root}/skin", vertices.T, both.T, _SKIN)
    for i, line in enumerate(lines):
        meshcat.SetLine(f"{root}/line_{i}", line.T, 1.0, _LINE)


def _triangles(grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices, shape (n, 3), and triangles between them, shape (k, 3)."""
    rows, columns = grid.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    return grid.reshape(-1, 3), faces.reshape(-1, 3)
