"""How paths, surfaces, regions and workpieces are drawn."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Protocol

import numpy as np
from pydrake.geometry import Meshcat, Rgba
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort

from diagrams.robots.workpiece import WorkpieceLook
from diagrams.tasks.regions_and_guides import DrawnFixture
from pfsc_drake.control.fixtures.guides import Guide
from pfsc_drake.control.manifolds.manifold import PlaceManifold
from pfsc_drake.control.manifolds.space import SpaceManifold
from pfsc_drake.geometry import Path, PathPointLayout
from pfsc_drake.geometry.path_on_surface import CurveOnSurface
from pfsc_drake.geometry.regions.moving import MovingRegion
from pfsc_drake.geometry.surfaces.parametric_surface import Surface
from pfsc_drake.systems.drawing.manifold_visualizer import (
    PathVisualizer,
    RegionVisualizer,
    SurfaceVisualizer,
    draw_guide,
    draw_surface,
)
from pfsc_drake.systems.drawing.numbers import SceneNumber
from pfsc_drake.systems.drawing.tool_visualizer import ToolVisualizer

_POINTS = 600
# of a surface, in each direction, and of the points of each line
_LINES, _LINE_POINTS = 11, 61
# of the tube round a guide, along it and round it
_TUBE_POINTS, _AROUND = 160, 17
_CORE = 2.5e-3  # m, radius of what stands for the guide itself


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
        """Return lines that show the manifold [m], each (points, 3)."""
        curve = self.path.position
        return [curve.derivatives(np.linspace(*curve.domain, _POINTS), 0)[:, 0]]

    def add(self, builder: DiagramBuilder, meshcat: Meshcat, period: float) -> InputPort:
        """Add what draws it."""
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
        """Return lines that show the manifold [m], each (points, 3)."""
        return skin_and_lines(self.surface)[1]

    def add(self, builder: DiagramBuilder, meshcat: Meshcat, period: float) -> InputPort:
        """Add what draws it."""
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


@dataclass(frozen=True)
class SpaceDrawing:
    """The surfaces of regions, drawn where they are at rest; with numbers if they are several.

    Attributes:
        fixtures: The regions.
        manifold: Space as the law sees it.
        guides: Paths that attract the tool, drawn with where they pull the most.
    """

    fixtures: Sequence[DrawnFixture]
    manifold: SpaceManifold
    guides: Sequence[Guide] = ()

    def outline(self) -> list[np.ndarray]:
        """Return lines that show the manifold [m], each (points, 3)."""
        surfaces = [surface for fixture in self.fixtures for surface in fixture.surfaces]
        lines = [line for surface in surfaces for line in skin_and_lines(surface)[1]]
        return lines + [_tube(guide, 0.0)[0] for guide in self.guides]

    def add(self, builder: DiagramBuilder, meshcat: Meshcat, period: float) -> InputPort:
        """Add what draws it."""
        for k, guide in enumerate(self.guides):
            tubes = _tube(guide, _CORE), _tube(guide, guide.strongest)
            draw_guide(meshcat, f"guides/{k}", *tubes)
        shapes: list[tuple[np.ndarray, list[np.ndarray]]] = []
        placements, firsts = {}, []
        for fixture in self.fixtures:
            firsts.append(len(shapes))
            for surface in fixture.surfaces:
                if isinstance(fixture.region, MovingRegion):
                    placements[len(shapes)] = partial(_placement, fixture.region)
                shapes.append(skin_and_lines(surface))
        numbers = region_numbers([skin for skin, _ in shapes], firsts)
        size = self.manifold.layout.size
        drawing = builder.AddNamedSystem(
            "region_visualizer",
            RegionVisualizer(shapes, placements, size, meshcat, period, numbers),
        )
        return drawing.GetInputPort("manifold_point")


def _tube(guide: Guide, radius: float) -> np.ndarray:
    """Return points at a radius [m] round a guide [m], shape (around, along, 3)."""
    curve = guide.path.position
    theta = np.linspace(*curve.domain, _TUBE_POINTS)
    line = curve.derivatives(theta, 0)[:, 0]
    angle = np.linspace(0.0, 2.0 * np.pi, _AROUND)[:, None, None]
    e_perp, e_cross = guide.path.frame.normals(theta)
    across = np.cos(angle) * e_perp + np.sin(angle) * e_cross
    return line + radius * across


# to who looks at the regions from their side with the robot to the left, and that one's right
_TO_VIEWER, _ACROSS = np.array([0.53, -0.79, 0.31]), np.array([0.83, 0.56, 0.0])
_NUMBER, _OWN = 0.06, 0.4  # height of a number against the size of all regions, and of its own


def region_numbers(skins: Sequence[np.ndarray], firsts: Sequence[int]) -> dict[int, SceneNumber]:
    """Return the number of each region, by its first surface; none for a single region.

    It stands where the region is next to who looks, before it.

    Args:
        skins: Points of all surfaces [m], each (rows, columns, 3).
        firsts: Index of each region's first surface.
    """
    if len(firsts) < 2:
        return {}
    clouds = [skin.reshape(-1, 3) for skin in skins]
    everything = np.concatenate(clouds)
    size = float(np.linalg.norm(np.ptp(everything, axis=0)))
    middle = everything.mean(axis=0)
    azimuth = np.arctan2(middle[1], middle[0])
    turn = RotationMatrix.MakeZRotation(azimuth).matrix()
    view, across = (turn @ v / np.linalg.norm(v) for v in (_TO_VIEWER, _ACROSS))
    numbers = {}
    for k, (first, end) in enumerate(pairwise([*firsts, len(clouds)])):
        points = np.concatenate(clouds[first:end])
        height = min(_NUMBER * size, _OWN * float(np.linalg.norm(np.ptp(points, axis=0))))
        middle = points[np.argmax(points @ view)] + height / 2.0 * view
        foot = middle - height / 2.0 * np.eye(3)[2]
        numbers[first] = SceneNumber(k + 1, foot, across, height)
    return numbers


def _placement(region: MovingRegion, clock: float) -> RigidTransform:
    """Return where what moves with a region is at a time of the clock."""
    rotation, origin = region.placement(clock)
    return RigidTransform(RotationMatrix(rotation), origin)


_WORKPIECE = Rgba(0.75, 0.72, 0.66, 0.75)
_VIEW = np.array([0.5, -0.4, 0.35])  # m, from the workpiece to the camera, z upwards


def add_workpiece_drawing(
    builder: DiagramBuilder,
    look: WorkpieceLook,
    tool_pose: OutputPort,
    meshcat: Meshcat,
    period: float,
) -> None:
    """Draw a workpiece, and let what touches it move with the tool.

    Args:
        builder: Builder of the replay.
        look: How they are drawn.
        tool_pose: ``[y_t, R_e]``.
        meshcat: Where to draw, axes of the inertial frame.
        period: Time between frames [s].
    """
    draw_workpiece(look, meshcat)
    tool = builder.AddNamedSystem(
        "tool_visualizer", ToolVisualizer(look.tool_parts, meshcat, period)
    )
    builder.Connect(tool_pose, tool.GetInputPort("tool_pose"))


def draw_workpiece(look: WorkpieceLook, meshcat: Meshcat) -> None:
    """Draw a workpiece.

    Args:
        look: How it is drawn.
        meshcat: Where to draw, axes of the inertial frame.
    """
    surface = look.surface
    meshcat.SetTriangleMesh("workpiece", surface.vertices.T, surface.triangles.T, _WORKPIECE)


def look_down_at(meshcat: Meshcat, target: np.ndarray) -> None:
    """Turn the camera to a workpiece.

    Args:
        meshcat: Whose camera it is.
        target: Where the workpiece is [m], shape (3,), z upwards.
    """
    meshcat.SetCameraPose(target + _VIEW, target)
