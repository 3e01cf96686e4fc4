"""Drawing of paths, surfaces, regions and workpieces."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Protocol

import numpy as np
from pydrake.geometry import Meshcat, Rgba
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort

from diagrams.robots.workpiece import WorkpieceDrawing
from diagrams.tasks.regions_and_guides import DrawnFixture
from pfsc_drake.control.fixtures.guides import Guide
from pfsc_drake.control.manifolds.manifold import ProjectedManifold
from pfsc_drake.control.manifolds.space import SpaceManifold
from pfsc_drake.geometry import Path, PathPointLayout
from pfsc_drake.geometry.path_on_surface import CurveOnSurface
from pfsc_drake.geometry.regions.moving import MovingRegion
from pfsc_drake.geometry.surfaces.parametric_surface import Surface
from pfsc_drake.systems.drawing.manifold_visualizer import (
    GUIDE_COLOR,
    LINE_COLOR,
    SKIN_COLOR,
    TUBE_COLOR,
    PathVisualizer,
    RegionVisualizer,
    SurfaceVisualizer,
    draw_guide,
    draw_surface,
)
from pfsc_drake.systems.drawing.numbers import SceneNumber
from pfsc_drake.systems.drawing.tool_visualizer import AXIS_COLORS, ToolVisualizer

AXIS = "axis: "  # begin of an axis' description in a legend
_POINTS = 600
# lines of a surface in each direction, and points of each line
_LINES, _LINE_POINTS = 11, 61
# points of the tube round a guide, along it and round it
_TUBE_POINTS, _AROUND = 160, 17
_CORE = 2.5e-3  # m, radius of the tube that shows the guide itself


class ManifoldDrawing(Protocol):
    """Drawing of a manifold, and of its frame next to the tool."""

    def outline(self) -> list[np.ndarray]:
        """Return lines that show the manifold [m], each (points, 3)."""

    def add(self, builder: DiagramBuilder, meshcat: Meshcat, period: float) -> InputPort:
        """Add the visualizer.

        Args:
            builder: Builder of the diagram.
            meshcat: Meshcat instance to draw in.
            period: Time between frames [s].

        Returns:
            Port for the point of the manifold next to the tool.
        """

    def legend(self) -> dict[str, Rgba]:
        """Return the colours of the drawing by the description of what has them."""


def axis_legend(*axes: str) -> dict[str, Rgba]:
    """Return the colours of a frame's three axes by their descriptions."""
    return {AXIS + text: color for text, color in zip(axes, AXIS_COLORS, strict=True)}


def path_axis_legend() -> dict[str, Rgba]:
    """Return the same of the frame of a path."""
    return axis_legend("tangent at the closest point of the path", "first normal", "second normal")


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
        """Add the visualizer."""
        curve = self.path.position
        if isinstance(curve, CurveOnSurface):
            draw_surface(meshcat, "path_surface", *skin_and_lines(curve.surface))
        visualizer = PathVisualizer(self.path, self.layout, meshcat, period)
        drawing = builder.AddNamedSystem("path_visualizer", visualizer)
        return drawing.GetInputPort("path_point")

    def legend(self) -> dict[str, Rgba]:
        """Return the colours of the drawing by the description of what has them."""
        on_surface = isinstance(self.path.position, CurveOnSurface)
        surface = {"surface of the path": SKIN_COLOR} if on_surface else {}
        return {"path": LINE_COLOR} | surface | path_axis_legend()


@dataclass(frozen=True)
class SurfaceDrawing:
    """A surface, drawn.

    Attributes:
        surface: The surface.
        manifold: Manifold of the law.
    """

    surface: Surface
    manifold: ProjectedManifold

    def outline(self) -> list[np.ndarray]:
        """Return lines that show the manifold [m], each (points, 3)."""
        return skin_and_lines(self.surface)[1]

    def add(self, builder: DiagramBuilder, meshcat: Meshcat, period: float) -> InputPort:
        """Add the visualizer."""
        layout = self.manifold.layout

        def frame(point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return point[layout.position][:3], self.manifold.axes(point).full()

        skin, lines = skin_and_lines(self.surface)
        drawing = builder.AddNamedSystem(
            "surface_visualizer",
            SurfaceVisualizer(skin, lines, layout.size, frame, meshcat, period),
        )
        return drawing.GetInputPort("manifold_point")

    def legend(self) -> dict[str, Rgba]:
        """Return the colours of the drawing by the description of what has them."""
        axes = axis_legend(
            "first tangent at the closest point of the surface", "second tangent", "normal"
        )
        return {"surface": SKIN_COLOR, "its coordinate lines": LINE_COLOR} | axes


def skin_and_lines(surface: Surface) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return points of a surface on a grid [m], shape (points, points, 3), and lines of it."""
    first, second = (np.linspace(*ends, _LINE_POINTS) for ends in surface.domain)
    theta = np.stack(np.meshgrid(first, second, indexing="ij"), axis=-1)
    grid = surface.partials(theta, 0)[..., 0, :]
    stride = (_LINE_POINTS - 1) // (_LINES - 1)
    return grid, [*grid[::stride], *np.swapaxes(grid, 0, 1)[::stride]]


@dataclass(frozen=True)
class SpaceDrawing:
    """The surfaces of regions, drawn at rest; with numbers if there are several.

    Attributes:
        fixtures: The regions.
        manifold: Manifold of the law, space.
        guides: Paths that attract the tool, drawn with the tube of the largest force.
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
        """Add the visualizer."""
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

    def legend(self) -> dict[str, Rgba]:
        """Return the colours of the drawing by the description of what has them."""
        entries = {"boundary of a region": SKIN_COLOR} if self.fixtures else {}
        if self.guides:
            entries["attracting path"] = GUIDE_COLOR
            entries["distance of its largest force"] = TUBE_COLOR
        return entries | axis_legend("world's x, drawn at the tool", "world's y", "world's z")


def _tube(guide: Guide, radius: float) -> np.ndarray:
    """Return points at a radius [m] round a guide [m], shape (around, along, 3)."""
    curve = guide.path.position
    theta = np.linspace(*curve.domain, _TUBE_POINTS)
    line = curve.derivatives(theta, 0)[:, 0]
    angle = np.linspace(0.0, 2.0 * np.pi, _AROUND)[:, None, None]
    e_perp, e_cross = guide.path.frame.normals(theta)
    across = np.cos(angle) * e_perp + np.sin(angle) * e_cross
    return line + radius * across


# directions to a viewer with the robot to the left, and to the viewer's right
_TO_VIEWER, _ACROSS = np.array([0.53, -0.79, 0.31]), np.array([0.83, 0.56, 0.0])
_NUMBER, _OWN = 0.06, 0.4  # height of a number against the size of all regions, and of its own


def region_numbers(skins: Sequence[np.ndarray], firsts: Sequence[int]) -> dict[int, SceneNumber]:
    """Return the number of each region, by its first surface; none for a single region.

    It stands in front of the point of the region that is next to the viewer.

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
        bottom = middle - height / 2.0 * np.eye(3)[2]
        numbers[first] = SceneNumber(k + 1, bottom, across, height)
    return numbers


def _placement(region: MovingRegion, clock: float) -> RigidTransform:
    """Return the pose of a region at a time of its clock."""
    rotation, origin = region.placement(clock)
    return RigidTransform(RotationMatrix(rotation), origin)


_WORKPIECE = Rgba(0.75, 0.72, 0.66, 0.75)
_VIEW = np.array([0.5, -0.4, 0.35])  # m, from the workpiece to the camera, z upwards


def add_workpiece_drawing(
    builder: DiagramBuilder,
    workpiece: WorkpieceDrawing,
    tool_pose: OutputPort,
    meshcat: Meshcat,
    period: float,
) -> None:
    """Draw a workpiece, and the touching part of the tool, which moves with the tool.

    Args:
        builder: Builder of the replay.
        workpiece: Drawing of both.
        tool_pose: ``[y_t, R_e]``.
        meshcat: Meshcat instance to draw in, axes of the inertial frame.
        period: Time between frames [s].
    """
    draw_workpiece(workpiece, meshcat)
    tool = builder.AddNamedSystem(
        "tool_visualizer", ToolVisualizer(workpiece.tool_parts, meshcat, period)
    )
    builder.Connect(tool_pose, tool.GetInputPort("tool_pose"))


def draw_workpiece(workpiece: WorkpieceDrawing, meshcat: Meshcat) -> None:
    """Draw a workpiece.

    Args:
        workpiece: Its drawing.
        meshcat: Meshcat instance to draw in, axes of the inertial frame.
    """
    surface = workpiece.surface
    meshcat.SetTriangleMesh("workpiece", surface.vertices.T, surface.triangles.T, _WORKPIECE)


def look_down_at(meshcat: Meshcat, target: np.ndarray) -> None:
    """Turn the camera to a workpiece.

    Args:
        meshcat: Meshcat instance with the camera.
        target: Position of the workpiece [m], shape (3,), z upwards.
    """
    meshcat.SetCameraPose(target + _VIEW, target)
