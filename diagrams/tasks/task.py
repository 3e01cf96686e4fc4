"""What a robot's tool is to do, whichever robot it is, and what that asks of the drives."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from diagrams.tasks.drawing import ManifoldDrawing
from pfsc_drake.blocks.block import Block
from pfsc_drake.control.manifolds.manifold import (
    PlaceEvaluator,
    Projector,
)
from pfsc_drake.following.task import Task as FollowingTask
from pfsc_drake.geometry import PiecewisePolynomialCurve, zyx_to_matrix
from pfsc_drake.geometry.surfaces.penalized_surface import Residuals
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


class Task(FollowingTask, ABC):
    """What a tool is to follow, and how it moves along.

    Attributes:
        fit: Where the points stand that the manifold was fitted to, if it was.
        warnings: What is out of proportion in it, one sentence each.
    """

    motion: PiecewisePolynomialCurve
    fit: Residuals | None = None
    warnings: list[str]

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
