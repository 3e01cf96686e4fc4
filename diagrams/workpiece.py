"""What a robot's tool may touch."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import GeometryId
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import Path
from pfsc_drake.systems.drawing.robot_visualizer import Surface
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
        surface: Surface of the workpiece, axes of the world.
        tool_parts: What of the tool touches it.
    """

    surface: Surface
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
    def start_shift(self, up: np.ndarray) -> np.ndarray:
        """Return how far from the path nothing is touched at the start [m], shape (3,).

        Args:
            up: Against gravity, unit vector in the world, shape (3,).
        """

    @abstractmethod
    def lengths(
        self, path: Path, y_t: np.ndarray, initial_theta: float, up: np.ndarray
    ) -> dict[str, FurtherLength]:
        """Return what is worth a look in a run, by name.

        Args:
            path: The path that the tool follows.
            y_t: Motion of the tool point [m], shape (samples, 3).
            initial_theta: Path parameter near the first sample.
            up: See :meth:`start_shift`.
        """

    @abstractmethod
    def look(self, up: np.ndarray) -> WorkpieceLook:
        """Return how it is drawn.

        Args:
            up: See :meth:`start_shift`.
        """


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
