"""What a robot's tool is to do, whichever robot it is, and what that asks of the drives."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from diagrams.tasks.drawing import ManifoldDrawing
from pfsc_drake.blocks.block import Block
from pfsc_drake.control.manifolds.manifold import (
    PlaceEvaluator,
    PlaceManifold,
    Projector,
)
from pfsc_drake.control.planning.limiting import Limiting
from pfsc_drake.following.task import Task as FollowingTask
from pfsc_drake.geometry import PiecewisePolynomialCurve, ShapeReport, zyx_to_matrix
from pfsc_drake.geometry.surfaces.penalized_surface import Residuals
from pfsc_drake.geometry.surfaces.regularity import SurfaceReport
from pfsc_drake.physics.hand_way import Place
from pfsc_drake.robot.inverse_kinematics import ToolTarget


@dataclass(frozen=True)
class StartPoint:
    """Where the tool starts, beside the manifold.

    Attributes:
        target: Tool point and what of its orientation matters.
        place: Nearest place on the manifold, as its projector remembers it.
    """

    target: ToolTarget
    place: np.ndarray


# of what drives can do, the largest share that a faster motion may ask for
_USED = 0.95


@dataclass(frozen=True)
class DrivePlan:
    """What a reference asks of the drives, as it is believed.

    Attributes:
        times: Times of the samples, in the time of the reference that is followed [s], (samples,).
        demand: Torques [Nm or N] and joint speeds [rad/s or m/s] that it asks for, (samples, 2N).
        asked: The same of the reference that was asked for, at the same places.
        limits: What is believed of the drives, (2N,).
        pace: Speed in units of the one that was asked for, (samples,).
        motion: The reference that is followed: the one asked for where that fits.
        said: What there is to say, one sentence each.
        limiting: Which limits it is at, if it is the fastest.
    """

    times: np.ndarray
    demand: np.ndarray
    asked: np.ndarray
    limits: np.ndarray
    pace: np.ndarray
    motion: PiecewisePolynomialCurve
    said: list[str]
    limiting: Limiting | None = None

    def fastest_pace(self, relative_degree: int) -> float:
        """Return how many times as fast the motion may be made, at least 1.

        Speeds grow with the pace, torques with its square at most, those of elastic joints with its
        power r.

        Args:
            relative_degree: r of the law.
        """
        if not len(self.demand):
            return 1.0
        most = np.abs(self.demand).max(axis=0)
        room = np.where(most > 0.0, _USED * self.limits / np.maximum(most, 1e-12), np.inf)
        torques, speeds = np.split(room, 2)
        power = 1.0 / max(relative_degree, 2)
        return float(max(1.0, min((torques**power).min(), speeds.min())))

    @property
    def speed(self) -> np.ndarray:
        """Speed of the reference, its largest tangential coordinate's [m/s], shape (samples,)."""
        return np.asarray(np.abs(self.motion.derivatives(self.times, 1)[:, 1]).max(axis=1))

    @property
    def waiting_time(self) -> float:
        """How much longer the motion takes than was asked for [s]."""
        return float(np.sum(np.diff(self.times) * (1.0 - (self.pace[1:] + self.pace[:-1]) / 2.0)))

    @property
    def is_slowed(self) -> bool:
        """Whether the reference is not the one that was asked for."""
        return bool(np.any(self.pace < 1.0))


class Task(FollowingTask, ABC):
    """What a tool is to follow, and how it moves along.

    Attributes:
        place: Manifold in whose coordinates the tool's true place is told.
        shape: Numbers of the manifold that decide whether it can be followed, if there are any.
        fit: Where the points stand that the manifold was fitted to, if it was.
        warnings: What is out of proportion in it, one sentence each.
        drive_plan: What the motion asks of the drives, once that has been found out.
    """

    place: PlaceManifold
    motion: PiecewisePolynomialCurve
    shape: ShapeReport | SurfaceReport | None
    fit: Residuals | None = None
    warnings: list[str]
    drive_plan: DrivePlan | None = None

    def inverted(self, start: StartPoint) -> tuple[ToolTarget, str] | None:
        """Return what a start may have been meant to be, and how to say so.

        Args:
            start: The start as the scenario says.

        Returns:
            The pose with the manifold's normal inverted, and advice; None where no normal decides.
        """
        return None

    @abstractmethod
    def require_joints(self, num_joints: int) -> None:
        """Refuse a robot that cannot follow, or would lose its orientation by oversight.

        Args:
            num_joints: Number of joints of the robot.

        Raises:
            InputError: If so.
        """

    @abstractmethod
    def evaluate(self, y_t: np.ndarray, memory: np.ndarray) -> np.ndarray:
        """Return the point of the true place's manifold next to a tool, shape (size,).

        Args:
            y_t: Tool point [m], shape (3,).
            memory: Place from which it is looked for, as the projector remembers it.
        """

    @property
    @abstractmethod
    def drawing(self) -> ManifoldDrawing:
        """How the manifold is drawn."""

    @property
    def projecting(self) -> Block:
        """Block that finds the closest point on the manifold."""
        return Projector(self.evaluator)

    @property
    @abstractmethod
    def evaluator(self) -> PlaceEvaluator:
        """What finds places on the true place's manifold."""

    def _tool_target(
        self, y_t: np.ndarray, R_d: np.ndarray | None, rotation_deg: Sequence[float]
    ) -> ToolTarget:
        """Return where a tool starts whose reference orientation is R_d, if there is one."""
        tool = self.place.tool
        if R_d is not None:
            R_d = R_d @ zyx_to_matrix(np.deg2rad(rotation_deg))
        return ToolTarget(y_t, R_d, tool.tool_axis, tool.yaw_axis)

    @abstractmethod
    def start(self, shift: np.ndarray) -> StartPoint:
        """Return where the tool starts.

        Args:
            shift: Beyond what the scenario says [m], shape (3,).

        Raises:
            InputError: If it is outside the feasible neighbourhood.
        """

    @abstractmethod
    def point(self, start: StartPoint) -> np.ndarray:
        """Return the point of the manifold that the law acts on at the start.

        Args:
            start: Where the tool starts.
        """

    @abstractmethod
    def way(self) -> Iterator[tuple[np.ndarray, str]]:
        """Yield positions along the way of the tool [m], each (3,), with what to call them."""

    @abstractmethod
    def target(self) -> Place:
        """Return where given coordinates of the manifold are in the world."""

    @abstractmethod
    def check_place(self, coordinates: np.ndarray, key: str) -> None:
        """Refuse coordinates off the manifold.

        Args:
            coordinates: Translational ones [m], shape (3,).
            key: Key of the scenario, for the message.

        Raises:
            InputError: If they are.
        """
