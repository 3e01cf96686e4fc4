"""Drawing of a streamed path, and of the plane in which a person draws."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from pydrake.geometry import Meshcat, Rgba
from pydrake.systems.framework import DiagramBuilder, InputPort

from diagrams.scenario.streamed import DrawnPlane
from diagrams.tasks.drawing import path_axis_legend
from pfsc_drake.checks import require
from pfsc_drake.geometry import PathPointLayout
from pfsc_drake.systems.drawing.manifold_visualizer import LINE_COLOR, LineVisualizer

_PARALLEL = 2e-3  # rad
SIDE = 20  # points of each side of a plane that is drawn


@dataclass(frozen=True)
class StreamDrawing:
    """Lines that are known beforehand, drawn, with the frame next to the tool.

    Attributes:
        lines: Points of each [m], each (points, 3).
        layout: Layout of the path's points.
    """

    lines: Sequence[np.ndarray]
    layout: PathPointLayout

    def outline(self) -> list[np.ndarray]:
        """Return lines that show the manifold [m], each (points, 3)."""
        return list(self.lines)

    def add(self, builder: DiagramBuilder, meshcat: Meshcat, period: float) -> InputPort:
        """Add the visualizer."""
        visualizer = LineVisualizer(self.lines, self.layout, meshcat, period)
        drawing = builder.AddNamedSystem("path_visualizer", visualizer)
        return drawing.GetInputPort("path_point")

    def legend(self) -> dict[str, Rgba]:
        """Return the colours of the drawing by the description of what has them."""
        return {"path or plane known beforehand": LINE_COLOR} | path_axis_legend()


def plane_axes(plane: DrawnPlane) -> np.ndarray:
    """Return the directions to the right and upwards, unit vectors, shape (2, 3).

    Args:
        plane: The plane.

    Raises:
        InputError: If they are parallel.
    """
    right, up = np.array(plane.right, dtype=float), np.array(plane.up, dtype=float)
    right /= np.linalg.norm(right)
    across = up - (up @ right) * right
    slanted = np.linalg.norm(across) > _PARALLEL * np.linalg.norm(up)
    require(bool(slanted), "path.shape.plane.up", plane.up, "a direction not parallel to right")
    return np.stack([right, across / np.linalg.norm(across)])


def border(plane: DrawnPlane) -> np.ndarray:
    """Return points along the border of a plane [m], shape (points, 3)."""
    across = plane_axes(plane) * np.array([[plane.width], [plane.height]]) / 2.0
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]])
    corners = np.array(plane.origin) + corners @ across
    steps = np.linspace(0.0, 1.0, SIDE, endpoint=False)[:, None]
    sides = [begin + steps * (end - begin) for begin, end in pairwise(corners)]
    return np.vstack([*sides, corners[-1:]])
