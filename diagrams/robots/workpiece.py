"""What a robot's tool may touch."""

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
    """Something else in a station that is worth a look.

    Attributes:
        values: Signal [m], shape (samples, size).
        labels: Name of each component.
        limit: Magnitude up to which it is free [m].
    """

    values: np.ndarray
    labels: list[str]
    limit: float


@dataclass(frozen=True)
class WorkpieceLook:
    """How a workpiece is drawn, and what of the tool touches it.

    Attributes:
        surface: Triangles of the workpiece, axes of the world.
        tool_parts: What of the tool touches it.
    """

    surface: Triangles
    tool_parts: list[ToolPart]


class Workpiece(ABC):
    """A workpiece in the world, and what on the tool touches it."""

    @property
    @abstractmethod
    def time_step(self) -> float:
        """Step of the plant with contact [s]."""

    @property
    @abstractmethod
    def reach(self) -> float:
        """Distance of what touches from the tool point [m]."""

    @property
    @abstractmethod
    def radius(self) -> float:
        """Its size [m]."""

    @abstractmethod
    def add(self, plant: MultibodyPlant, tool: Frame) -> list[GeometryId]:
        """Fix the workpiece to the world, and what touches it to the tool.

        Args:
            plant: A plant that is registered with a scene graph and not finalized.
            tool: Frame at the tool point.

        Returns:
            Contact geometries of the tool.

        Raises:
            InputError: If it is not known where up is.
        """

    @abstractmethod
    def start_shift(self, gravity: np.ndarray) -> np.ndarray:
        """Return how far from the start of the task nothing is touched [m], shape (3,).

        Args:
            gravity: Gravitational acceleration in the world [m/s^2], shape (3,).

        Raises:
            InputError: If it is not known where up is.
        """

    @abstractmethod
    def lengths(
        self, y_t: np.ndarray, initial_place: np.ndarray, gravity: np.ndarray
    ) -> dict[str, FurtherLength]:
        """Return what is worth a look in a run, by name.

        Args:
            y_t: Motion of the tool point [m], shape (samples, 3).
            initial_place: Place on the manifold near the first sample.
            gravity: Gravitational acceleration in the world [m/s^2], shape (3,).
        """

    @abstractmethod
    def look(self, gravity: np.ndarray) -> WorkpieceLook:
        """Return how it is drawn.

        Args:
            gravity: Gravitational acceleration in the world [m/s^2], shape (3,).
        """

    @abstractmethod
    def check_start(self, y_t: np.ndarray) -> None:
        """Refuse a start inside of the workpiece.

        Args:
            y_t: Tool point at the start [m], shape (3,).

        Raises:
            InputError: If it is.
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
        key: What needs it, for the message.

    Raises:
        InputError: If there is no gravity.
    """
    size = float(np.linalg.norm(gravity))
    if size == 0.0:
        raise InputError(f"{key}: gravity is zero; where up is must be known")
    return 0.0 - gravity / size
