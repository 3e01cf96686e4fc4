"""Path following, and for comparison trajectory tracking along a path."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from pfsc_drake.control.manifolds.manifold import Projector
from pfsc_drake.control.manifolds.moving_point import MovingPoint, TrajectoryPoint
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.controller.tasks.task import StartPoint, Task
from pfsc_drake.errors import InputError, require
from pfsc_drake.geometry import (
    Path,
    PiecewisePolynomialCurve,
    ProjectionStatus,
    ShapeReport,
    quaternion_to_matrix,
    shape_report,
)
from pfsc_drake.geometry.paths.geometric_path import PathTarget
from pfsc_drake.geometry.paths.path_evaluator import PathEvaluator

# m, between the positions along the path
_SPACING = 2e-3
_MAX_ALPHA = 0.95


class PathTask(Task):
    """Path following: the tool converges to a path, independent of its speed along it.

    Args:
        path: The path.
        motion: Arc length over time [m].
        relative_degree: Relative degree r of the law.
        angles: Choice of the orientation's coordinates, see :class:`PathManifold`.
        tracks: Whether a trajectory is tracked instead (Sec. 3.8.4).
        offset: Transversal coordinates of the tool at the start [m], shape (2,).
        rotation_deg: ZYX angles of the tool at the start from the path's orientation [deg].
        max_alpha: End of the feasible neighbourhood, below 1.

    Attributes:
        path: The path.
        relative_degree: r.
    """

    projector_name = "path_projector"
    projected_manifold: PathManifold
    motion: PiecewisePolynomialCurve
    shape: ShapeReport

    def __init__(
        self,
        path: Path,
        motion: PiecewisePolynomialCurve,
        relative_degree: int,
        angles: dict[str, Any] | None = None,
        *,
        tracks: bool = False,
        offset: Sequence[float] = (0.0, 0.0),
        rotation_deg: Sequence[float] = (0.0, 0.0, 0.0),
        max_alpha: float = _MAX_ALPHA,
    ) -> None:
        self.path, self.motion, self.relative_degree = path, motion, relative_degree
        self._tracks, self._offset, self._rotation_deg = tracks, offset, rotation_deg
        self._max_alpha, self.shape, self.warnings = max_alpha, shape_report(path), []
        followed: dict[str, Any] = {
            "oriented": path.orientation is not None,
            **(angles or {}),
            "turning": path.frame.turns,
            "length": None if path.closed else path.length,
        }
        self.projected_manifold = PathManifold(relative_degree, **followed)
        self.manifold = self.projected_manifold
        if tracks:
            self.manifold = MovingPoint(relative_degree, **followed)
            count = len(self.manifold.coordinates)
            self.prescribed_point = TrajectoryPoint(path, relative_degree, count)

    @property
    def evaluator(self) -> PathEvaluator:
        """Functions that find the closest point."""
        return self.path.evaluator(self.relative_degree)

    @property
    def projection_block(self) -> Projector:
        """Block that finds the closest point on the manifold."""
        return Projector(self.evaluator)

    @property
    def revolution(self) -> float | None:
        """Length of the manifold [m] if it is closed in its only direction."""
        return self.path.length if self.path.closed else None

    @property
    def length(self) -> float:
        """Length of the manifold [m] if it is a path; else 0."""
        return self.path.length

    def evaluate(self, y_t: np.ndarray, memory: np.ndarray) -> np.ndarray:
        """Return the point of ``projected_manifold`` closest to a tool, shape (size,)."""
        return self.evaluator(y_t.tolist(), memory[0])

    def start(self, shift: np.ndarray) -> StartPoint:
        """Return the start of the tool."""
        eta = float(self.motion.derivatives(self.motion.domain[:1], 0)[0, 0, 0])
        theta = self.path.arc_length.parameter(eta)
        layout, evaluator = self.projected_manifold.layout, self.evaluator
        on_path = evaluator.evaluate_at(theta)
        axes = self.projected_manifold.axes(on_path).full()
        beside = self._offset[0] * axes[:, 1], self._offset[1] * axes[:, 2]
        y_t = on_path[layout.position][:3] + beside[0] + beside[1] + shift
        point = evaluator(y_t.tolist(), theta)
        alpha = point[layout.alpha].item()
        if point[layout.status] == ProjectionStatus.NOT_CONVERGED or not alpha < self._max_alpha:
            raise InputError(
                f"start.offset: {self._offset} m at eta = {eta:g} m, "
                f"{np.round(y_t, 6).tolist()} m, is outside the feasible neighbourhood of the path"
                f", alpha = {alpha:.3g}; alpha must be below {self._max_alpha:g}"
            )
        R_d = None
        if self.path.orientation is not None:
            R_d = quaternion_to_matrix(on_path[layout.quaternion][:4])
        return StartPoint(self._target(y_t, R_d, self._rotation_deg), point[layout.memory])

    def point(self, start: StartPoint) -> np.ndarray:
        """Return the point of the manifold on which the law acts at the start, shape (size,)."""
        if self._tracks:
            return self.evaluator.evaluate_at(start.projection[0])
        return super().point(start)

    def tool_positions(self) -> Iterator[tuple[np.ndarray, str]]:
        """Iterate over positions of the tool along its motion [m], each (3,), with their names."""
        visited = self.motion.derivatives(self.motion.breakpoints, 0)[:, 0, 0]
        begin, end = float(visited.min()), float(visited.max())
        if self.path.closed:  # every revolution is the same
            end = min(end, begin + self.path.length)
        samples = np.linspace(begin, end, 2 + int((end - begin) / _SPACING))
        theta = np.array([self.path.arc_length.parameter(eta) for eta in samples])
        for eta, position in zip(samples, self.path.position.derivatives(theta, 0), strict=True):
            yield position[0], f"path at eta = {eta:.4g} m"

    @property
    def target(self) -> PathTarget:
        """Map from coordinates of the manifold to positions in the world."""
        return PathTarget(self.path)

    def check_coordinates(self, coordinates: np.ndarray, key: str) -> None:
        """Refuse coordinates off the manifold."""
        allowed = f"eta from 0 to {self.path.length:.6g} m"
        require(is_on(self.path, coordinates[0]), key, coordinates.tolist(), allowed)


def is_on(path: Path, eta: float) -> bool:
    """Return whether an arc length is on a path, its ends included up to rounding.

    Args:
        path: The path.
        eta: Arc length [m].
    """
    rounding = 1e-9 * path.length
    return path.closed or -rounding <= eta <= path.length + rounding
