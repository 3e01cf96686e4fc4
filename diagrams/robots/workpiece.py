"""Workpiece that a robot's tool may touch."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import GeometryId
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame

from pfsc_drake.errors import InputError
from pfsc_drake.systems.drawing.robot_visualizer import Triangles
from pfsc_drake.systems.drawing.tool_visualizer import ToolPart


@dataclass
class FurtherLength:
    """Further length of a station, for logs and figures.

    Attributes:
        values: Signal [m], shape (samples, size).
        labels: Name of each component.
        limit: Magnitude up to which there is no contact [m].
    """

    values: np.ndarray
    labels: list[str]
    limit: float


@dataclass(frozen=True)
class WorkpieceDrawing:
    """Drawing of a workpiece, and of the parts of the tool that touch it.

    Attributes:
        surface: Triangles of the workpiece, axes of the world.
        tool_parts: Parts of the tool that touch it.
    """

    surface: Triangles
    tool_parts: list[ToolPart]


class Workpiece(ABC):
    """A workpiece in the world, and the part of the tool that touches it."""

    @property
    @abstractmethod
    def time_step(self) -> float:
        """Step of the plant with contact [s]."""

    @property
    @abstractmethod
    def reach(self) -> float:
        """Distance of the touching part from the tool point [m]."""

    @property
    @abstractmethod
    def radius(self) -> float:
        """Its size [m]."""

    @abstractmethod
    def add(self, plant: MultibodyPlant, tool: Frame) -> list[GeometryId]:
        """Fix the workpiece to the world, and the part that touches it to the tool.

        Args:
            plant: A plant that is registered with a scene graph and not finalized.
            tool: Frame at the tool point.

        Returns:
            Contact geometries of the tool.

        Raises:
            InputError: If there is no gravity, which defines the upward direction.
        """

    @abstractmethod
    def start_shift(self, gravity: np.ndarray) -> np.ndarray:
        """Return the displacement from the start of the task to a free position [m], shape (3,).

        Args:
            gravity: Gravitational acceleration in the world [m/s^2], shape (3,).

        Raises:
            InputError: If there is no gravity, which defines the upward direction.
        """

    @abstractmethod
    def lengths(
        self, y_t: np.ndarray, initial_projection: np.ndarray, gravity: np.ndarray
    ) -> dict[str, FurtherLength]:
        """Return further lengths of a run, by name.

        Args:
            y_t: Motion of the tool point [m], shape (samples, 3).
            initial_projection: Projection onto the manifold near the first sample.
            gravity: Gravitational acceleration in the world [m/s^2], shape (3,).
        """

    @abstractmethod
    def drawing(self, gravity: np.ndarray) -> WorkpieceDrawing:
        """Return the drawing of the workpiece.

        Args:
            gravity: Gravitational acceleration in the world [m/s^2], shape (3,).
        """

    @abstractmethod
    def check_start(self, y_t: np.ndarray) -> None:
        """Refuse a start inside of the workpiece.

        Args:
            y_t: Tool point at the start [m], shape (3,).

        Raises:
            InputError: If it is inside.
        """

    def normal(self, axes: np.ndarray) -> np.ndarray | None:
        """Return the direction in which it presses at the tool, shape (3,), if there is one.

        Args:
            axes: Axes of the manifold next to the tool as columns, shape (3, 3).
        """
        del axes
        return None


def upwards(gravity: np.ndarray, key: str) -> np.ndarray:
    """Return the unit vector against gravity, shape (3,).

    Args:
        gravity: Gravitational acceleration in the world [m/s^2], shape (3,).
        key: Key of the scenario, for the message.

    Raises:
        InputError: If there is no gravity.
    """
    size = float(np.linalg.norm(gravity))
    if size == 0.0:
        raise InputError(f"{key}: gravity is zero; it must define the upward direction")
    return 0.0 - gravity / size
