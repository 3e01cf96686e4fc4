"""Surfaces of forbidden regions in Meshcat."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, EventStatus, LeafSystem

from pfsc_drake.systems.drawing.moving_frame import draw_frame
from pfsc_drake.systems.drawing.surface_visualizer import draw_surface

_ROOT = "fixtures"


class RegionVisualizer(LeafSystem):
    """Draws the surfaces that a tool may not cross, and the world's axes at the tool.

    Ports:
        manifold_point (input): Of the space manifold, the tool point first.
        region_clock (input, optional): Time of the clock by which regions move [s], shape (1,).

    Args:
        surfaces: Of each region points on a grid [m], shape (rows, columns, 3), and lines on it
            [m], each (points, 3).
        moving: How regions that move are placed at a time of the clock, by their index.
        size: Of the manifold's point.
        meshcat: Where to draw.
        period: Time between frames [s].
    """

    def __init__(
        self,
        surfaces: Sequence[tuple[np.ndarray, Sequence[np.ndarray]]],
        moving: Mapping[int, Callable[[float], RigidTransform]],
        size: int,
        meshcat: Meshcat,
        period: float,
    ) -> None:
        super().__init__()
        self._surfaces, self._moving, self._meshcat = surfaces, moving, meshcat
        self._point = self.DeclareVectorInputPort("manifold_point", size)
        self._clock = self.DeclareVectorInputPort("region_clock", 1)
        self.DeclareInitializationPublishEvent(self._draw_surfaces)
        self.DeclarePeriodicPublishEvent(period, 0.0, self._draw)

    def _draw_surfaces(self, context: Context) -> EventStatus:
        for i, (skin, lines) in enumerate(self._surfaces):
            draw_surface(self._meshcat, f"{_ROOT}/{i}", skin, lines)
        draw_frame(self._meshcat, f"{_ROOT}/frame")
        return EventStatus.Succeeded()

    def _draw(self, context: Context) -> None:
        position = self._point.Eval(context)[:3]
        if np.isfinite(position).all():
            X_WF = RigidTransform(position)
            self._meshcat.SetTransform(f"{_ROOT}/frame", X_WF, context.get_time())
        if not self._clock.HasValue(context):
            return
        clock = float(self._clock.Eval(context)[0])
        for i, placement in self._moving.items():
            self._meshcat.SetTransform(f"{_ROOT}/{i}", placement(clock), context.get_time())
