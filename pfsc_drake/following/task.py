"""A task of a tool: a manifold, its projection, and the motion along it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pfsc_drake.blocks.block import Block
from pfsc_drake.control.fixtures.guides import Guide
from pfsc_drake.control.fixtures.lead import Lead
from pfsc_drake.control.fixtures.parameters import Admittance, Fixture
from pfsc_drake.control.manifolds.manifold import Manifold, PlaceManifold
from pfsc_drake.control.manifolds.moving_point import TrajectoryPoint
from pfsc_drake.control.manifolds.space import SpaceManifold
from pfsc_drake.control.planning.course import Projection
from pfsc_drake.following.options.follower import FixtureOptions
from pfsc_drake.following.planning.drive_plan import DrivePlan
from pfsc_drake.following.streamed_path import StreamedPath
from pfsc_drake.geometry import PiecewisePolynomialCurve, ShapeReport
from pfsc_drake.geometry.surfaces.regularity import SurfaceReport
from pfsc_drake.robot.inverse_kinematics import ToolTarget


@dataclass(frozen=True)
class Guided:
    """Hand guiding of a tool through space.

    Attributes:
        place: Space, with the orientation that the tool keeps.
        fixtures: The M regions.
        speeds: Speeds of each the largest speed near the tool [m/s].
        motion: The free motion.
        lead: Filter between the requested velocity and the tool.
        options: Further options.
        guides: Paths that attract the tool.
    """

    place: SpaceManifold
    fixtures: Sequence[Fixture]
    speeds: Sequence[float]
    motion: Admittance
    lead: Lead
    options: FixtureOptions
    guides: Sequence[Guide] = ()


class Task:
    """Task of a tool, whichever robot moves it.

    Attributes:
        projector_name: Name of the system that finds the closest point.
        manifold: Manifold that the law linearizes; in its own frame, where that moves.
        place: Manifold in whose coordinates the tool's position is measured: the same but where a
            trajectory is tracked.
        motion: Tangential coordinates of the reference over time [m]; None where a hand guides the
            tool, and where waypoints come while it moves.
        warnings: Doubts about manifold and motion, one sentence each.
        guided: Regions and paths of a tool that a hand guides through space.
        streamed: Path whose waypoints come while the tool moves.
        prescribed_point: Block with the point that the law acts on, where time prescribes it.
        shape: Numbers of the manifold that decide whether it can be followed, if they are known.
        drive_plan: Demand of the motion on the drives, once it is planned.
    """

    projector_name: ClassVar[str] = "projector"

    manifold: Manifold
    place: PlaceManifold
    motion: PiecewisePolynomialCurve | None
    warnings: Sequence[str] = ()
    guided: Guided | None = None
    streamed: StreamedPath | None = None
    prescribed_point: TrajectoryPoint | None = None
    shape: ShapeReport | SurfaceReport | None = None
    drive_plan: DrivePlan | None = None

    @property
    def projecting(self) -> Block:
        """Block that finds the closest point on the manifold."""
        raise NotImplementedError

    def evaluate(self, y_t: np.ndarray, memory: np.ndarray) -> np.ndarray:
        """Return the point of ``place`` next to a tool, shape (size,).

        Args:
            y_t: Tool point [m], shape (3,).
            memory: Position from which it is looked for, as the projector remembers it.
        """
        raise NotImplementedError

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


@dataclass
class Followed(Task):
    """Task with its start, for a robot that is known.

    Attributes:
        manifold: See :class:`Task`.
        place: See :class:`Task`.
        projector: Finds the closest point on it.
        motion: See :class:`Task`.
        start: Pose of the tool when the motion begins.
        point: The manifold's point there, laid out by the manifold's layout.
        path_length: Length of the path [m], if there is one.
        closed: Whether the path is closed.
        guided: See :class:`Task`.
        streamed: See :class:`Task`.
        projection: Finds the closest point on the manifold beforehand.
        prescribed_point: See :class:`Task`.
        shape: See :class:`Task`.
        warnings: See :class:`Task`.
    """

    manifold: Manifold
    place: PlaceManifold
    projector: Block
    motion: PiecewisePolynomialCurve | None
    start: ToolTarget
    point: np.ndarray
    path_length: float = 0.0
    closed: bool = False
    guided: Guided | None = None
    streamed: StreamedPath | None = None
    projection: Projection | None = None
    prescribed_point: TrajectoryPoint | None = None
    shape: ShapeReport | SurfaceReport | None = None
    warnings: Sequence[str] = ()

    @property
    def projecting(self) -> Block:
        """Block that finds the closest point on the manifold."""
        return self.projector

    def evaluate(self, y_t: np.ndarray, memory: np.ndarray) -> np.ndarray:
        """Return the point of ``place`` next to a tool, shape (size,)."""
        assert self.projection is not None  # as the motion is known beforehand
        return self.projection(y_t, memory)

    @property
    def lap(self) -> float | None:
        """Length of the manifold [m] if it is closed in its only direction."""
        return self.path_length if self.closed else None

    @property
    def length(self) -> float:
        """Length of the manifold [m] if it is a path; else 0."""
        return self.path_length
