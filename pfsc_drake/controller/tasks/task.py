"""Task of a tool: manifold, projection, motion along the manifold, and start."""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pfsc_drake.blocks.block import Block
from pfsc_drake.control.manifolds.manifold import Manifold, ProjectedManifold
from pfsc_drake.control.manifolds.moving_point import TrajectoryPoint
from pfsc_drake.controller.planning.drive_plan import DrivePlan
from pfsc_drake.geometry import PiecewisePolynomialCurve, ShapeReport, zyx_to_matrix
from pfsc_drake.geometry.surfaces.penalized_surface import Residuals
from pfsc_drake.geometry.surfaces.regularity import SurfaceReport
from pfsc_drake.physics.hand_path import CoordinateMap
from pfsc_drake.robot.inverse_kinematics import ToolTarget


@dataclass(frozen=True)
class StartPoint:
    """Start of the tool, on the manifold or beside it.

    Attributes:
        target: Pose of the tool, as far as its orientation matters.
        projection: Position on the manifold, as the projector stores it.
    """

    target: ToolTarget
    projection: np.ndarray


class Task(ABC):
    """Task of a tool, independent of the robot.

    Attributes:
        projector_name: Name of the system that finds the closest point.
        manifold: Manifold that the law linearizes; in its own frame, where that moves.
        projected_manifold: Manifold of the tool's measured coordinates: the same unless a
            trajectory is tracked.
        motion: Tangential coordinates of the reference over time [m]; None for hand guiding and
            streamed waypoints.
        warnings: Doubts about manifold and motion, one sentence each.
        prescribed_point: Block with the point on which the law acts, if time prescribes it.
        shape: Report on the regularity of the manifold, if it is known.
        fit: Residuals of the fit, if the manifold was fitted to points.
        drive_plan: Demand of the motion on the drives, after planning.
    """

    projector_name: ClassVar[str]

    manifold: Manifold
    projected_manifold: ProjectedManifold
    motion: PiecewisePolynomialCurve | None
    warnings: list[str]
    prescribed_point: TrajectoryPoint | None = None
    shape: ShapeReport | SurfaceReport | None = None
    fit: Residuals | None = None
    drive_plan: DrivePlan | None = None

    @property
    @abstractmethod
    def projection_block(self) -> Block:
        """Block that finds the closest point on the manifold."""

    @abstractmethod
    def evaluate(self, y_t: np.ndarray, memory: np.ndarray) -> np.ndarray:
        """Return the point of ``projected_manifold`` closest to a tool, shape (size,).

        Args:
            y_t: Tool point [m], shape (3,).
            memory: Initial guess of the projection, as the projector stores it.
        """

    @abstractmethod
    def start(self, shift: np.ndarray) -> StartPoint:
        """Return the start of the tool.

        Args:
            shift: Shift of its position [m], shape (3,).

        Raises:
            InputError: If the start is outside the feasible neighbourhood.
        """

    def point(self, start: StartPoint) -> np.ndarray:
        """Return the point of the manifold on which the law acts at the start, shape (size,).

        Args:
            start: Start of the tool.
        """
        return self.evaluate(start.target.y_t, start.projection)

    @abstractmethod
    def tool_positions(self) -> Iterator[tuple[np.ndarray, str]]:
        """Iterate over positions of the tool along its motion [m], each (3,), with their names."""

    @property
    @abstractmethod
    def target(self) -> CoordinateMap:
        """Map from coordinates of the manifold to positions in the world."""

    @abstractmethod
    def check_coordinates(self, coordinates: np.ndarray, key: str) -> None:
        """Refuse coordinates off the manifold.

        Args:
            coordinates: Translational coordinates [m], shape (3,).
            key: Name of the coordinates, for the message.

        Raises:
            InputError: If the coordinates are off the manifold.
        """

    @property
    def is_planned(self) -> bool:
        """Whether the motion along the manifold is known beforehand."""
        return self.motion is not None

    @property
    def revolution(self) -> float | None:
        """Length of the manifold [m] if it is closed in its only direction."""
        return None

    @property
    def length(self) -> float:
        """Length of the manifold [m] if it is a path; else 0."""
        return 0.0

    @property
    def end(self) -> float:
        """Time at which the motion ends [s]."""
        return math.inf if self.motion is None else float(self.motion.domain[1])

    def _target(
        self, y_t: np.ndarray, R_d: np.ndarray | None, rotation_deg: Sequence[float]
    ) -> ToolTarget:
        """Return the pose of a tool at a position, turned from the reference orientation R_d."""
        tool = self.projected_manifold.tool
        if R_d is not None:
            R_d = R_d @ zyx_to_matrix(np.deg2rad(rotation_deg))
        return ToolTarget(y_t, R_d, tool.tool_axis, tool.yaw_axis)
