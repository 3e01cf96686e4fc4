"""What stands around a robot, as a file: obstacles, and how low its tool may go."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import models_directory
from pfsc_drake.robot.models.visuals import Shape, check_shape
from pfsc_drake.yaml.typed import REQUIRED, load_file


@dataclass
class Obstacle(Shape):
    """A primitive that does not move, in the world frame; see :class:`Shape`.

    Attributes:
        name: For messages.
        beside: Links of the model that are next to it by design and not checked against it.
    """

    material: str = ""
    name: str = field(default="obstacle", metadata=REQUIRED)
    beside: list[str] = field(default_factory=list)


@dataclass
class Cell:
    """What a motion must keep clear of.

    Attributes:
        obstacles: None of them may be touched.
        tool_above: Least z of the end effector in the world [m], the flange where there is no tool;
            minus infinity for any.
        clearance: Least distance between the robot and obstacles, and between links that are not
            neighbours [m].
        self_collision: Whether links that are no neighbours are checked against each other.
        joined: Pairs of links that are not, since joint limits keep them apart.
    """

    obstacles: list[Obstacle] = field(default_factory=list)
    tool_above: float = -np.inf
    clearance: float = 0.02
    self_collision: bool = True
    joined: list[list[str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        for i, obstacle in enumerate(self.obstacles):
            check_shape(f"obstacles[{i}]", obstacle)
        if np.isnan(self.tool_above) or self.tool_above == np.inf:
            raise InputError(f"tool_above = {self.tool_above}; must be a number [m]")
        for pair in self.joined:
            if len(pair) != 2:
                raise InputError(f"joined: {pair}; must be pairs of names of links")
        if not 0.0 <= self.clearance < np.inf:
            raise InputError(f"clearance = {self.clearance}; must be zero or positive [m]")


def load_cell(cell: str | Path | None, robot: str | Path) -> Cell:
    """Return the cell of a file, or that of a shipped robot.

    Args:
        cell: YAML file; None for the one shipped with the robot, or an empty one.
        robot: Name of the robot.

    Raises:
        InputError: If the file cannot be read or does not fit; one line that names it.
    """
    if cell is None:
        shipped = models_directory() / Path(robot).stem / "cell.yaml"
        return load_file(Cell, shipped) if shipped.is_file() else Cell()
    return load_file(Cell, cell)
