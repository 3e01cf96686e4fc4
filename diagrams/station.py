"""What running, logging and measuring need to know of a station, whatever its robot."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from pydrake.systems.framework import Context, Diagram

from diagrams.signal_log import SignalLog
from pfsc_drake.control.path_law import PathLaw
from pfsc_drake.geometry import Path
from pfsc_drake.robot.chain_from_plant import PlantCoordinates
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.path_following_controller import PathFollowingController
from pfsc_drake.systems.path_projector import PathProjector

Plant = TypeVar("Plant")
Robot = TypeVar("Robot", bound=RobotModel)


@dataclass
class Station(ABC, Generic[Plant, Robot]):
    """A built station and what is needed to run it.

    Attributes:
        diagram: The diagram.
        plant: The robot in it; its continuous state is ``[q, v]``.
        chain: The robot as the laws know it.
        coordinates: Where its coordinates stand in the plant's state.
        path: The path.
        law: The path following law.
        projector: Projector system.
        controller: Controller system.
        log: Log of ``joint_state``, ``tool_pose``, ``path_point``, ``reference``, ``law``,
            and whatever else the station has.
        reference_duration: Length of the reference motion [s].
        initial_state: State of the plant at the start.
        initial_theta: Path parameter at the start.
        on_motors: Whether the law acts on the tool pose of the motors, not of the links.
        warnings: What may not go as well as hoped, one sentence each.
    """

    diagram: Diagram
    plant: Plant
    chain: Robot
    coordinates: PlantCoordinates
    path: Path
    law: PathLaw
    projector: PathProjector
    controller: PathFollowingController
    log: SignalLog
    reference_duration: float
    initial_state: np.ndarray
    initial_theta: float
    on_motors: bool
    warnings: list[str]

    def set_start(self, root: Context) -> None:
        """Put the robot at the start of the scenario.

        Args:
            root: Context of the diagram.
        """
        self.place_robot(self.plant.GetMyMutableContextFromRoot(root))  # type: ignore[attr-defined]
        self.projector.set_parameter(
            self.projector.GetMyMutableContextFromRoot(root), self.initial_theta
        )

    @abstractmethod
    def place_robot(self, context: Context) -> None:
        """Put the plant into its initial state.

        Args:
            context: Context of the plant.
        """
