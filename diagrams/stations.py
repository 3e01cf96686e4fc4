"""The right station, schema and recording for the robot that a scenario names."""

from collections.abc import Mapping
from pathlib import Path as FilePath
from typing import Any, Protocol

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.systems.framework import Context, Diagram, System

from diagrams.delta_following import build_delta_following, load_delta_robot
from diagrams.delta_replay import build_delta_replay
from diagrams.path_following import build_path_following
from diagrams.replay import RecordedMotion, build_replay
from diagrams.scenario import PathFollowingScenario
from diagrams.scenario_delta import DeltaFollowingScenario
from diagrams.signal_log import SignalLog
from pfsc_drake.control.path_law import PathLaw
from pfsc_drake.geometry import Path
from pfsc_drake.robot.chain_from_plant import PlantCoordinates
from pfsc_drake.robot.delta_parameters import SHIPPED_ROBOTS as DELTA_ROBOTS
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.systems.path_following_controller import PathFollowingController
from pfsc_drake.systems.path_projector import PathProjector
from pfsc_drake.typed_yaml import load_typed


class Station(Protocol):
    """What running, logging and measuring need to know of a station, whatever its robot.

    See :class:`~diagrams.path_following.PathFollowingStation` for the attributes. The plant's
    continuous state is ``[q, v]``.
    """

    @property
    def diagram(self) -> Diagram:
        """The diagram."""

    @property
    def plant(self) -> System:
        """The robot in it."""

    @property
    def chain(self) -> RobotModel:
        """The robot as the laws know it."""

    @property
    def coordinates(self) -> PlantCoordinates:
        """Where its coordinates stand in the plant's state."""

    @property
    def path(self) -> Path:
        """The path."""

    @property
    def law(self) -> PathLaw:
        """The path following law."""

    @property
    def projector(self) -> PathProjector:
        """Projector system."""

    @property
    def controller(self) -> PathFollowingController:
        """Controller system."""

    @property
    def log(self) -> SignalLog:
        """Log of the run."""

    @property
    def reference_duration(self) -> float:
        """Length of the reference motion [s]."""

    @property
    def initial_state(self) -> np.ndarray:
        """State of the plant at the start."""

    @property
    def initial_theta(self) -> float:
        """Path parameter at the start."""

    @property
    def on_motors(self) -> bool:
        """Whether the law acts on the tool pose of the motors, not of the links."""

    @property
    def warnings(self) -> list[str]:
        """What may not go as well as hoped, one sentence each."""

    def set_start(self, root: Context) -> None:
        """Put the robot at the start of the scenario."""


def is_delta(model: str) -> bool:
    """Return whether a robot model is a DELTA robot: a shipped one, or a file of parameters."""
    return model in DELTA_ROBOTS or FilePath(model).suffix in (".yaml", ".yml")


def load_settings(data: dict[str, Any], source: str) -> PathFollowingScenario:
    """Load a scenario into the schema that suits its robot.

    Args:
        data: The scenario as read.
        source: Name of the file, for messages.

    Raises:
        InputError: If the scenario does not fit the schema.
    """
    robot = data.get("robot")
    model = robot.get("model") if isinstance(robot, Mapping) else None
    delta = isinstance(model, str) and is_delta(model)
    return load_typed(DeltaFollowingScenario if delta else PathFollowingScenario, data, source)


def build_station(settings: PathFollowingScenario, folder: FilePath) -> Station:
    """Build the station of a scenario.

    Args:
        settings: From :func:`load_settings`.
        folder: Where the scenario's relative file names start.

    Raises:
        InputError: If the scenario cannot be built.
    """
    if isinstance(settings, DeltaFollowingScenario):
        return build_delta_following(settings, folder)
    return build_path_following(settings, folder)


def build_station_replay(
    settings: PathFollowingScenario,
    folder: FilePath,
    station: Station,
    motion: RecordedMotion,
    meshcat: Meshcat,
) -> Diagram:
    """Return a diagram that draws a station's recorded motion while its time advances.

    Args:
        settings: The scenario that was run.
        folder: Where its relative file names start.
        station: Its station.
        motion: What to draw.
        meshcat: Where to draw.
    """
    period, layout = settings.simulation.frame_period, station.law.linearization.layout
    if isinstance(settings, DeltaFollowingScenario):
        robot = load_delta_robot(settings.robot, folder)
        return build_delta_replay(robot, station.path, layout, motion, meshcat, period)
    return build_replay(settings.robot, folder, station.path, layout, motion, meshcat, period)
