"""What running, logging and measuring need to know of a station, whatever its robot."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from pydrake.systems.framework import Context, Diagram

from diagrams.signal_log import SignalLog
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.law import PathLaw
from pfsc_drake.geometry import Path
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.serial.chain_from_plant import PlantCoordinates
from pfsc_drake.systems.control.can_fail import CanFail
from pfsc_drake.systems.control.path_following_controller import PathFollowingController
from pfsc_drake.systems.control.path_projector import PathProjector

Plant = TypeVar("Plant")
Robot = TypeVar("Robot", bound=RobotModel)


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


@dataclass
class Station(ABC, Generic[Plant, Robot]):
    """A built station and what is needed to run it.

    Attributes:
        diagram: The diagram.
        plant: The robot in it.
        chain: The robot as the laws know it.
        coordinates: Where its coordinates stand in the state ``[q, v]`` of its model.
        path: The path.
        law: The path following law.
        projector: Projector system.
        controller: Controller system.
        log: Log of ``joint_state``, ``tool_pose``, ``path_point``, ``reference``, ``law``,
            and whatever else the station has. With imperfect encoders ``joint_state`` is the
            truth, and the law was given ``joint_state_measured``.
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
        context = self.plant.GetMyMutableContextFromRoot(root)  # type: ignore[attr-defined]
        self.place_robot(context, self.initial_state)
        self.projector.set_parameter(
            self.projector.GetMyMutableContextFromRoot(root), self.initial_theta
        )

    def fault(self, root: Context) -> str | None:
        """Return why a system of the station is in its safe state, or None if none is.

        Args:
            root: Context of the diagram.
        """
        for system in self.diagram.GetSystems():
            name, context = system.get_name(), system.GetMyContextFromRoot(root)
            fault = system.fault(context) if isinstance(system, CanFail) else Fault.NONE
            if fault is not Fault.NONE:
                prefix = "" if system is self.controller else f"{name}: "
                return prefix + fault.explanation
        return None

    def further_lengths(self, y_t: np.ndarray) -> dict[str, FurtherLength]:
        """Return what else is worth a look in a run, if anything is.

        Args:
            y_t: Motion of the tool point [m], shape (samples, 3).

        Returns:
            By name.
        """
        return {}

    @abstractmethod
    def place_robot(self, context: Context, state: np.ndarray) -> None:
        """Put the plant into a state.

        Args:
            context: Context of the plant.
            state: ``[q, v]``, see ``coordinates``.
        """
