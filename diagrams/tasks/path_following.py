"""Following a path, and for comparison tracking a point that moves along it with time."""

from collections.abc import Iterator
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from diagrams.scenario import (
    ControllerParameters,
    PathParameters,
    ReferenceParameters,
    StartParameters,
    SurfaceParameters,
)
from diagrams.scenario.checks import require
from diagrams.tasks.drawing import PathDrawing
from diagrams.tasks.task import StartPoint, Task
from diagrams.tasks.task_geometry import (
    followed_angles,
    make_path,
    make_path_on_surface,
    require_joints,
    require_orientation,
    surface_of_path,
)
from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.control.law.reference import rest_to_rest
from pfsc_drake.control.manifolds.moving_point import MovingPoint, TrajectoryPoint
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    ProjectionStatus,
    quaternion_to_matrix,
    shape_report,
)
from pfsc_drake.geometry.paths.geometric_path import PathTarget
from pfsc_drake.geometry.paths.path_evaluator import PathEvaluator
from pfsc_drake.geometry.paths.path_warnings import closing_gap, euler_warnings, path_warnings
from pfsc_drake.geometry.progress import Progress

# m, between the points of the way along the path
_SPACING = 2e-3
_ORIENTATIONS = 1001
_LOOKS_CLOSED = "; it ends where it starts: if it is to go round, write path.shape.closed: true"


class PathTask(Task):
    """Path following: the tool converges to a path at whatever pace.

    Args:
        parameters: The path.
        surface: The surface that it lies on, if its shape is one on a surface.
        controller: The controller; its law decides how smooth the path must be.
        reference: The motion along the path.
        start: Where the tool starts beside the path.
        folder: Where relative file names start.
        progress: Told the fraction done and what is done, where that takes its time.

    Raises:
        InputError: If the path or the motion along it cannot be made.
    """

    projector_name = "path_projector"
    _law_manifold: type[PathManifold] = PathManifold
    place: PathManifold

    def __init__(
        self,
        parameters: PathParameters,
        surface: SurfaceParameters | None,
        controller: ControllerParameters,
        reference: ReferenceParameters,
        start: StartParameters,
        folder: FilePath,
        progress: Progress | None = None,
    ) -> None:
        self._start_parameters, law = start, controller.law
        self._max_alpha = controller.max_alpha
        surface = surface_of_path(parameters, surface)
        self._is_on_surface, self._orientation_task = (
            surface is not None,
            parameters.orientation.task,
        )
        if surface is None:
            self.path = make_path(parameters, law, folder, progress)
            said: Any = parameters.orientation
        else:
            self.path = make_path_on_surface(parameters, surface, law, folder, progress)
            said = surface.orientation
        self.shape = shape_report(self.path)
        self.warnings = path_warnings(self.path, self.shape)
        self.relative_degree = RELATIVE_DEGREE[law]
        followed: dict[str, Any] = {
            "oriented": self.path.orientation is not None,
            **followed_angles(said),
            "turning": self.path.frame.turns,
            "length": None if self.path.closed else self.path.length,
        }
        self.place = PathManifold(self.relative_degree, **followed)
        self.manifold = self._law_manifold(self.relative_degree, **followed)
        if self.manifold.follows_time:
            count = len(self.manifold.coordinates)
            self.prescribed_point = TrajectoryPoint(self.path, self.relative_degree, count)
        self.warnings += self._euler_warnings("path" if surface is None else "surface")
        self._points = reference.arc_lengths(self.path.length)
        self._check_points(self._points)
        self.motion = rest_to_rest(
            self._points,
            velocity=reference.largest_velocity,
            acceleration=reference.acceleration,
            dwell=reference.dwell,
        )

    @property
    def lap(self) -> float | None:
        """Length of the manifold [m] if it is closed in its only direction."""
        return self.path.length if self.path.closed else None

    @property
    def length(self) -> float:
        """Length of the manifold [m] if it is a path; else 0."""
        return self.path.length

    def require_joints(self, num_joints: int) -> None:
        """Refuse a robot that cannot follow, or would lose its orientation by oversight."""
        if self._is_on_surface:
            require_joints(self.manifold, num_joints)
        else:
            require_orientation(self.path, self._orientation_task, num_joints)

    def evaluate(self, y_t: np.ndarray, memory: np.ndarray) -> np.ndarray:
        """Return the point of the true place's manifold next to a tool, shape (size,)."""
        return self.evaluator(y_t.tolist(), memory[0])

    @property
    def evaluator(self) -> PathEvaluator:
        """What finds places on the true place's manifold."""
        return self.path.evaluator(self.relative_degree)

    @property
    def drawing(self) -> PathDrawing:
        """How the manifold is drawn."""
        return PathDrawing(self.path, self.place.layout)

    def _check_points(self, points: list[float]) -> None:
        """Refuse arc lengths off the ends of an open path."""
        for eta in points:
            if not self._is_on_path(eta):
                closed = closing_gap(self.path) is not None
                raise InputError(
                    f"reference.points: {eta:g} m; the path is open and "
                    f"{self.path.length:.6g} m long{_LOOKS_CLOSED if closed else ''}"
                )

    def _euler_warnings(self, block: str) -> list[str]:
        """Return :func:`euler_warnings` of the path's orientation, which a block tells."""
        orientation, euler = self.path.orientation, self.place.tool.euler
        if orientation is None or euler is None:
            return []
        theta = np.linspace(*self.path.position.domain, _ORIENTATIONS)
        eta, R_d = self.path.arc_length(theta), orientation.rotation_matrix(theta)
        return euler_warnings(euler, R_d, block, lambda i: f"at eta = {eta[i]:.4g} m")

    def _is_on_path(self, eta: float) -> bool:
        """Return whether an arc length is on the path, up to its very ends but for rounding."""
        rounding = 1e-9 * self.path.length
        return self.path.closed or -rounding <= eta <= self.path.length + rounding

    def start(self, shift: np.ndarray) -> StartPoint:
        """Return where the tool starts."""
        start, eta, max_alpha = self._start_parameters, self._points[0], self._max_alpha
        theta = self.path.arc_length.parameter(eta)
        layout = self.place.layout
        evaluator = self.evaluator
        on_path = evaluator.evaluate_at(theta)
        axes = self.place.axes(on_path).full()
        beside = start.offset[0] * axes[:, 1], start.offset[1] * axes[:, 2]
        y_t = on_path[layout.position][:3] + beside[0] + beside[1] + shift
        point = evaluator(y_t.tolist(), theta)
        alpha = point[layout.alpha].item()
        if point[layout.status] == ProjectionStatus.NOT_CONVERGED or not alpha < max_alpha:
            raise InputError(
                f"start.offset: {start.offset} m at eta = {eta:g} m, "
                f"{np.round(y_t, 6).tolist()} m, is outside the feasible neighbourhood of the path"
                f", alpha = {alpha:.3g}; alpha must be below {max_alpha:g}"
            )
        R_d = None
        if self.path.orientation is not None:
            R_d = quaternion_to_matrix(on_path[layout.quaternion][:4])
        target = self._tool_target(y_t, R_d, start.rotation_deg)
        return StartPoint(target, point[layout.memory])

    def point(self, start: StartPoint) -> np.ndarray:
        """Return the point of the manifold that the law acts on at the start."""
        return self.evaluator(start.target.y_t.tolist(), start.place[0])

    def way(self) -> Iterator[tuple[np.ndarray, str]]:
        """Yield positions along the way of the tool [m], each (3,), with what to call them."""
        begin, end = min(self._points), max(self._points)
        if self.path.closed:  # every round is the same
            end = min(end, begin + self.path.length)
        places = np.linspace(begin, end, 2 + int((end - begin) / _SPACING))
        theta = np.array([self.path.arc_length.parameter(eta) for eta in places])
        for eta, position in zip(places, self.path.position.derivatives(theta, 0), strict=True):
            yield position[0], f"path at eta = {eta:.4g} m"

    def target(self) -> PathTarget:
        """Return where given coordinates of the manifold are in the world."""
        return PathTarget(self.path)

    def check_place(self, coordinates: np.ndarray, key: str) -> None:
        """Refuse coordinates off the manifold."""
        allowed = f"eta from 0 to {self.path.length:.6g} m"
        require(self._is_on_path(coordinates[0]), key, coordinates.tolist(), allowed)


class TrajectoryTask(PathTask):
    """Classical tracking of a point that moves along the path with time (Sec. 3.8.4)."""

    _law_manifold = MovingPoint

    def point(self, start: StartPoint) -> np.ndarray:
        """Return the point of the manifold that the law acts on at the start."""
        return self.evaluator.evaluate_at(start.place[0])
