"""How a manifold is drawn."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.systems.framework import DiagramBuilder, InputPort

from pfsc_drake.control.manifolds.manifold import PlaceManifold
from pfsc_drake.geometry import Path, PathPointLayout
from pfsc_drake.geometry.path_on_surface import CurveOnSurface
from pfsc_drake.geometry.surfaces.surface import Surface
from pfsc_drake.systems.drawing.path_visualizer import PathVisualizer
from pfsc_drake.systems.drawing.surface_visualizer import SurfaceVisualizer, draw_surface

_POINTS = 600
# of a surface, in each direction, and of the points of each line
_LINES, _LINE_POINTS = 11, 61


class ManifoldDrawing(Protocol):
    """What draws a manifold, and its frame next to the tool."""

    def outline(self) -> list[np.ndarray]:
        """Return lines that show the manifold [m], each (points, 3)."""

    def add(self, builder: DiagramBuilder, meshcat: Meshcat, period: float) -> InputPort:
        """Add what draws it.

        Args:
            builder: Builder of the diagram.
            meshcat: Where to draw.
            period: Time between frames [s].

        Returns:
            Port for the point of the manifold next to the tool.
        """


@dataclass(frozen=True)
class PathDrawing:
    """A path, drawn, and the surface that it lies on, if any.

    Attributes:
        path: The path.
        layout: Layout of its points.
    """

    path: Path
    layout: PathPointLayout

    def outline(self) -> list[np.ndarray]:
        """See :class:`ManifoldDrawing`."""
        curve = self.path.position
        return [curve.derivatives(np.linspace(*curve.domain, _POINTS), 0)[:, 0]]

    def add(self, builder: DiagramBuilder, meshcat: Meshcat, period: float) -> InputPort:
        """See :class:`ManifoldDrawing`."""
        curve = self.path.position
        if isinstance(curve, CurveOnSurface):
            draw_surface(meshcat, "path_surface", *skin_and_lines(curve.surface))
        visualizer = PathVisualizer(self.path, self.layout, meshcat, period)
        drawing = builder.AddNamedSystem("path_visualizer", visualizer)
        return drawing.GetInputPort("path_point")


@dataclass(frozen=True)
class SurfaceDrawing:
    """A surface, drawn.

    Attributes:
        surface: The surface.
        manifold: As the law sees it.
    """

    surface: Surface
    manifold: PlaceManifold

    def outline(self) -> list[np.ndarray]:
        """See :class:`ManifoldDrawing`."""
        return skin_and_lines(self.surface)[1]

    def add(self, builder: DiagramBuilder, meshcat: Meshcat, period: float) -> InputPort:
        """See :class:`ManifoldDrawing`."""
        layout = self.manifold.layout

        def place(point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return point[layout.position][:3], self.manifold.axes(point).full()

        skin, lines = skin_and_lines(self.surface)
        drawing = builder.AddNamedSystem(
            "surface_visualizer",
            SurfaceVisualizer(skin, lines, layout.size, place, meshcat, period),
        )
        return drawing.GetInputPort("manifold_point")


def skin_and_lines(surface: Surface) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return points of a surface on a grid [m], shape (points, points, 3), and lines of it."""
    first, second = (np.linspace(*ends, _LINE_POINTS) for ends in surface.domain)
    theta = np.stack(np.meshgrid(first, second, indexing="ij"), axis=-1)
    grid = surface.partials(theta, 0)[..., 0, :]
    stride = (_LINE_POINTS - 1) // (_LINES - 1)
    return grid, [*grid[::stride], *np.swapaxes(grid, 0, 1)[::stride]]
