"""How a manifold is drawn."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.systems.framework import DiagramBuilder, InputPort

from pfsc_drake.geometry import Path, PathPointLayout
from pfsc_drake.systems.drawing.path_visualizer import PathVisualizer

_POINTS = 600


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
    """A path, drawn.

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
        visualizer = PathVisualizer(self.path, self.layout, meshcat, period)
        drawing = builder.AddNamedSystem("path_visualizer", visualizer)
        return drawing.GetInputPort("path_point")
