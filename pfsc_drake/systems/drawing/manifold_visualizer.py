"""Paths, surfaces and regions in Meshcat, and colours of signed values."""

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import numpy as np
from pydrake.geometry import Meshcat, Rgba
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context, EventStatus, LeafSystem

from pfsc_drake.geometry import Path, PathPointLayout
from pfsc_drake.systems.drawing.numbers import SceneNumber
from pfsc_drake.systems.drawing.tool_visualizer import draw_frame

_PATH_ROOT, _SURFACE_ROOT, _REGION_ROOT = "path_following", "surface_following", "fixtures"
LINE_COLOR = Rgba(0.15, 0.4, 0.85, 1.0)
_PATH_POINTS = 800


class LineVisualizer(LeafSystem):
    """Draws lines of a path, and the parallel transport frame at the closest point.

    The frame's axes are red ``e_par``, green ``e_perp``, blue ``e_cross``.

    Ports:
        path_point (input): Path point from the projector.

    Args:
        lines: Points of each line [m], each (points, 3).
        layout: Layout of the path point.
        meshcat: Meshcat instance.
        period: Time between frames [s].
    """

    def __init__(
        self,
        lines: Sequence[np.ndarray],
        layout: PathPointLayout,
        meshcat: Meshcat,
        period: float,
    ) -> None:
        super().__init__()
        self._lines, self._layout, self._meshcat = lines, layout, meshcat
        self._path_point = self.DeclareVectorInputPort("path_point", layout.size)
        self.DeclareInitializationPublishEvent(self._draw_path)
        self.DeclarePeriodicPublishEvent(period, 0.0, self._draw)

    def _draw_path(self, context: Context) -> EventStatus:
        for k, points in enumerate(self._lines):
            name = f"{_PATH_ROOT}/path_{k}" if k else f"{_PATH_ROOT}/path"
            self._meshcat.SetLine(name, points.T, 3.0, LINE_COLOR)
        draw_frame(self._meshcat, f"{_PATH_ROOT}/frame")
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
        self._meshcat.SetTransform(f"{_PATH_ROOT}/frame", RigidTransform(R_WF, position[:3]), time)


class PathVisualizer(LineVisualizer):
    """Draws a known path, see :class:`LineVisualizer`.

    Args:
        path: The path.
        layout: Layout of the path point.
        meshcat: Meshcat instance.
        period: Time between frames [s].
    """

    def __init__(
        self, path: Path, layout: PathPointLayout, meshcat: Meshcat, period: float
    ) -> None:
        theta = np.linspace(*path.position.domain, _PATH_POINTS)
        line = path.position.derivatives(theta, 0)[:, 0, :]
        super().__init__([line], layout, meshcat, period)


SKIN_COLOR = Rgba(0.45, 0.65, 0.95, 0.35)
GUIDE_COLOR, TUBE_COLOR = Rgba(0.85, 0.35, 0.05), Rgba(0.95, 0.65, 0.2, 0.2)


class SurfaceVisualizer(LeafSystem):
    """Draws a surface, and its frame at the closest point.

    The frame's axes are red the first tangent, green the perpendicular tangent, blue the normal.

    Ports:
        manifold_point (input): Manifold point from the projector.

    Args:
        skin: Points of the surface on a grid [m], shape (rows, columns, 3).
        lines: Lines on it [m], each (points, 3).
        size: Size of the manifold's point.
        frame: ``point -> (position, axes)``, shapes (3,) and (3, 3).
        meshcat: Meshcat instance.
        period: Time between frames [s].
    """

    def __init__(
        self,
        skin: np.ndarray,
        lines: Sequence[np.ndarray],
        size: int,
        frame: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
        meshcat: Meshcat,
        period: float,
    ) -> None:
        super().__init__()
        self._skin, self._lines, self._frame, self._meshcat = skin, lines, frame, meshcat
        self._point = self.DeclareVectorInputPort("manifold_point", size)
        self.DeclareInitializationPublishEvent(self._draw_surface)
        self.DeclarePeriodicPublishEvent(period, 0.0, self._draw)

    def _draw_surface(self, context: Context) -> EventStatus:
        draw_surface(self._meshcat, _SURFACE_ROOT, self._skin, self._lines)
        draw_frame(self._meshcat, f"{_SURFACE_ROOT}/frame")
        return EventStatus.Succeeded()

    def _draw(self, context: Context) -> None:
        point = self._point.Eval(context)
        if not np.isfinite(point).all():
            return
        position, axes = self._frame(point)
        X_WF = RigidTransform(RotationMatrix.ProjectToRotationMatrix(axes), position)
        self._meshcat.SetTransform(f"{_SURFACE_ROOT}/frame", X_WF, context.get_time())


def draw_surface(
    meshcat: Meshcat, root: str, skin: np.ndarray, lines: Sequence[np.ndarray]
) -> None:
    """Draw a translucent surface.

    Args:
        meshcat: Meshcat instance.
        root: Meshcat path of the surface.
        skin: Points of the surface on a grid [m], shape (rows, columns, 3).
        lines: Lines on it [m], each (points, 3).
    """
    vertices, faces = _triangles(skin)
    both = np.vstack([faces, faces[:, ::-1]])
    meshcat.SetTriangleMesh(f"{root}/skin", vertices.T, both.T, SKIN_COLOR)
    for i, line in enumerate(lines):
        meshcat.SetLine(f"{root}/line_{i}", line.T, 1.0, LINE_COLOR)


def draw_guide(meshcat: Meshcat, root: str, core: np.ndarray, tube: np.ndarray) -> None:
    """Draw an attracting path and a translucent tube around it.

    Args:
        meshcat: Meshcat instance.
        root: Meshcat path of the drawing.
        core: Points of a thin tube, the path itself, on a grid [m], shape (rows, columns, 3).
        tube: Points of a wide one [m], likewise.
    """
    for name, grid, colour in (("path", core, GUIDE_COLOR), ("tube", tube, TUBE_COLOR)):
        vertices, faces = _triangles(grid)
        both = np.vstack([faces, faces[:, ::-1]])
        meshcat.SetTriangleMesh(f"{root}/{name}", vertices.T, both.T, colour)


def _triangles(grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices, shape (n, 3), and triangles between them, shape (k, 3)."""
    rows, columns = grid.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    return grid.reshape(-1, 3), faces.reshape(-1, 3)


# largest number of readable labels; of more, those nearest to the tool are shown
_READABLE = 8


class RegionVisualizer(LeafSystem):
    """Draws the boundaries of regions, and the world's axes at the tool.

    Of more than eight numbers those of the nearest regions are shown.

    Ports:
        manifold_point (input): Point of the space manifold, the tool point first.
        region_clock (input, optional): Time of the clock by which regions move [s], shape (1,).

    Args:
        surfaces: Surfaces of each region points on a grid [m], shape (rows, columns, 3), and lines
            on it [m], each (points, 3).
        moving: Pose of each moving region at a time of the clock, by its index.
        size: Size of the manifold's point.
        meshcat: Meshcat instance.
        period: Time between frames [s].
        numbers: Numbers beside surfaces, by their index, which move with them.
    """

    def __init__(
        self,
        surfaces: Sequence[tuple[np.ndarray, Sequence[np.ndarray]]],
        moving: Mapping[int, Callable[[float], RigidTransform]],
        size: int,
        meshcat: Meshcat,
        period: float,
        numbers: Mapping[int, SceneNumber] = MappingProxyType({}),
    ) -> None:
        super().__init__()
        self._surfaces, self._moving, self._meshcat = surfaces, moving, meshcat
        self._numbers, self._visible = numbers, set(numbers)
        ends = [*numbers, len(surfaces)][1:]
        self._clouds = {
            first: np.concatenate([skin.reshape(-1, 3) for skin, _ in surfaces[first:end]])
            for first, end in zip(numbers, ends, strict=True)
        }
        self._point = self.DeclareVectorInputPort("manifold_point", size)
        self._clock = self.DeclareVectorInputPort("region_clock", 1)
        self.DeclareInitializationPublishEvent(self._draw_surfaces)
        self.DeclarePeriodicPublishEvent(period, 0.0, self._draw)

    def _draw_surfaces(self, context: Context) -> EventStatus:
        for i, (skin, lines) in enumerate(self._surfaces):
            draw_surface(self._meshcat, f"{_REGION_ROOT}/{i}", skin, lines)
        for i, shown in self._numbers.items():
            shown.draw(self._meshcat, f"{_REGION_ROOT}/{i}/number")
        self._visible = set(self._numbers)
        draw_frame(self._meshcat, f"{_REGION_ROOT}/frame")
        return EventStatus.Succeeded()

    def _draw(self, context: Context) -> None:
        position = self._point.Eval(context)[:3]
        if np.isfinite(position).all():
            X_WF = RigidTransform(position)
            self._meshcat.SetTransform(f"{_REGION_ROOT}/frame", X_WF, context.get_time())
        poses: dict[int, RigidTransform] = {}
        if self._clock.HasValue(context):
            clock = float(self._clock.Eval(context)[0])
            poses = {i: placement(clock) for i, placement in self._moving.items()}
        for i, X_WR in poses.items():
            self._meshcat.SetTransform(f"{_REGION_ROOT}/{i}", X_WR, context.get_time())
        if len(self._numbers) > _READABLE and np.isfinite(position).all():
            self._show_nearest(position, poses, context.get_time())

    def _show_nearest(
        self, position: np.ndarray, poses: Mapping[int, RigidTransform], time: float
    ) -> None:
        """Show the numbers of the regions nearest to the tool."""
        distances = {}
        for i, cloud in self._clouds.items():
            p_R = poses[i].inverse() @ position if i in poses else position
            distances[i] = float(np.square(cloud - p_R).sum(axis=1).min())
        nearest = set(sorted(distances, key=distances.__getitem__)[:_READABLE])
        for i in self._visible ^ nearest:  # those that change
            path = f"{_REGION_ROOT}/{i}/number"
            self._meshcat.SetProperty(path, "visible", i in nearest, time)
        self._visible = nearest


# red, green, blue of the lowest value, of zero, and of the highest
_LOW, _ZERO, _HIGH = (0.0, 0.35, 1.0), (0.12, 0.12, 0.12), (1.0, 0.15, 0.0)


def signed_color(value: float, largest: float) -> Rgba:
    """Return the colour of a value: blue below zero, dark at zero, red above.

    Args:
        value: The value, in any unit.
        largest: Magnitude that has full colour, in the same unit, positive; larger ones have it,
            too.
    """
    share = min(abs(value) / largest, 1.0)
    end = _HIGH if value > 0.0 else _LOW
    red, green, blue = (zero + share * (x - zero) for zero, x in zip(_ZERO, end, strict=True))
    return Rgba(red, green, blue, 1.0)
