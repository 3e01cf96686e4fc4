"""The right station, schema and recording for the robot that a scenario names."""

from collections.abc import Mapping
from pathlib import Path as FilePath
from typing import Any

from pydrake.geometry import Meshcat
from pydrake.systems.framework import Diagram

from diagrams.delta_following import build_delta_following, load_delta_robot
from diagrams.drawing.delta_replay import build_delta_replay
from diagrams.drawing.replay import RecordedMotion, build_replay
from diagrams.drawing.robot_geometry import RobotDrawing, draw_robot
from diagrams.path_following import PathFollowingStation, build_path_following
from diagrams.scenario import PathFollowingScenario
from diagrams.scenario.delta import DeltaFollowingScenario
from diagrams.station import Station
from pfsc_drake.robot.delta.parameters import SHIPPED_ROBOTS as DELTA_ROBOTS
from pfsc_drake.yaml.typed import load_typed


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


def draw_station(
    settings: PathFollowingScenario, folder: FilePath, station: Station
) -> RobotDrawing | None:
    """Read what a station's robot looks like, or return None if that is known without files.

    Args:
        settings: The scenario that is to be run.
        folder: Where its relative file names start.
        station: Its station.
    """
    if not isinstance(station, PathFollowingStation):
        return None
    return draw_robot(station.arm.model, station.arm.tool, settings.robot, folder)


def build_station_replay(
    settings: PathFollowingScenario,
    folder: FilePath,
    station: Station,
    drawing: RobotDrawing | None,
    motion: RecordedMotion,
    meshcat: Meshcat,
) -> Diagram:
    """Return a diagram that draws a station's recorded motion while its time advances.

    Args:
        settings: The scenario that was run.
        folder: Where its relative file names start.
        station: Its station.
        drawing: What its robot looks like, from :func:`draw_station`.
        motion: What to draw.
        meshcat: Where to draw.
    """
    period, layout = settings.simulation.frame_period, station.law.linearization.layout
    if isinstance(settings, DeltaFollowingScenario):
        robot = load_delta_robot(settings.robot, folder)
        return build_delta_replay(
            robot, station.path, layout, motion, meshcat, period, settings.notch
        )
    assert drawing is not None  # draw_station knows every other robot
    return build_replay(drawing, station.path, layout, motion, meshcat, period)
