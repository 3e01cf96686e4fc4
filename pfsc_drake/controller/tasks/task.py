"""A task of a tool: a manifold, its projection, the motion along it, and where both begin."""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pfsc_drake.blocks.block import Block
from pfsc_drake.control.manifolds.manifold import Manifold, PlaceManifold
from pfsc_drake.control.manifolds.moving_point import TrajectoryPoint
from pfsc_drake.controller.planning.drive_plan import DrivePlan
from pfsc_drake.geometry import PiecewisePolynomialCurve, ShapeReport, zyx_to_matrix
from pfsc_drake.geometry.surfaces.penalized_surface import Residuals
from pfsc_drake.geometry.surfaces.regularity import SurfaceReport
from pfsc_drake.physics.hand_way import Place
from pfsc_drake.robot.inverse_kinematics import ToolTarget


@dataclass(frozen=True)
class StartPoint:
    """Start of the tool, on the manifold or beside it.

    Attributes:
        target: Pose of the tool, as far as its orientation matters.
        place: Position on the manifold, as its projector remembers it.
    """

    target: ToolTarget
    place: np.ndarray


class Task(ABC):
    """Task of a tool, whichever robot moves it.

    Attributes:
        projector_name: Name of the system that finds the closest point.
        manifold: Manifold that the law linearizes; in its own frame, where that moves.
        place: Manifold in whose coordinates the tool's position is measured: the same but where a
            trajectory is tracked.
        motion: Tangential coordinates of the reference over time [m]; None where nothing but a hand
            or waypoints that come decide on it.
        warnings: Doubts about manifold and motion, one sentence each.
        prescribed_point: Block with the point that the law acts on, where time prescribes it.
        shape: Numbers of the manifold that decide whether it can be followed, if they are known.
        fit: Distances of the points that the manifold was fitted to, if it was.
        drive_plan: Demand of the motion on the drives, once it is planned.
    """

    projector_name: ClassVar[str]

    manifold: Manifold
    place: PlaceManifold
    motion: PiecewisePolynomialCurve | None
    warnings: list[str]
    prescribed_point: TrajectoryPoint | None = None
    shape: ShapeReport | SurfaceReport | None = None
    fit: Residuals | None = None
    drive_plan: DrivePlan | None = None

    @property
    @abstractmethod
    def projecting(self) -> Block:
        """Block that finds the closest point on the manifold."""

    @abstractmethod
    def evaluate(self, y_t: np.ndarray, memory: np.ndarray) -> np.ndarray:
        """Return the point of ``place`` next to a tool, shape (size,).

        Args:
            y_t: Tool point [m], shape (3,).
            memory: Position from which it is looked for, as the projector remembers it.
        """

    @abstractmethod
    def start(self, shift: np.ndarray) -> StartPoint:
        """Return where the tool starts.

        Args:
            shift: Added to its position [m], shape (3,).

        Raises:
            InputError: If it is outside the feasible neighbourhood.
        """

    def point(self, start: StartPoint) -> np.ndarray:
        """Return the point of the manifold that the law acts on at the start, shape (size,).

        Args:
            start: Start of the tool.
        """
        return self.evaluate(start.target.y_t, start.place)

    @abstractmethod
    def way(self) -> Iterator[tuple[np.ndarray, str]]:
        """Yield positions of the tool along its motion [m], each (3,), with their names."""

    @property
    @abstractmethod
    def target(self) -> Place:
        """Map from coordinates of the manifold to positions in the world."""

    @abstractmethod
    def check_place(self, coordinates: np.ndarray, key: str) -> None:
        """Refuse coordinates off the manifold.

        Args:
            coordinates: Translational ones [m], shape (3,).
            key: Their name, for the message.

        Raises:
            InputError: If they are.
        """

    @property
    def is_planned(self) -> bool:
        """Whether the motion along the manifold is known beforehand."""
        return self.motion is not None

    @property
    def lap(self) -> float | None:
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
        tool = self.place.tool
        if R_d is not None:
            R_d = R_d @ zyx_to_matrix(np.deg2rad(rotation_deg))
        return ToolTarget(y_t, R_d, tool.tool_axis, tool.yaw_axis)
