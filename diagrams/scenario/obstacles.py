"""Obstacles that cross the path, how they are measured, and how progress waits for them."""

import dataclasses as dc

from diagrams.scenario.checks import require
from pfsc_drake.control.obstacles.elbow_room import ElbowParameters
from pfsc_drake.control.obstacles.parameters import WatchParameters
from pfsc_drake.physics.moving_obstacle import ObstacleParameters, ObstacleSensorParameters


@dc.dataclass
class CrossingParameters:
    """Obstacles, for a tool that follows a path or a surface.

    Attributes:
        moving: What moves, and where.
        sensor: What measures it.
        watch: How progress waits for it.
        elbow: How the elbow of an arm with joints to spare gives way; it does not without.
    """

    moving: list[ObstacleParameters] = dc.field(default_factory=lambda: [ObstacleParameters()])
    sensor: ObstacleSensorParameters = dc.field(default_factory=ObstacleSensorParameters)
    watch: WatchParameters = dc.field(default_factory=WatchParameters)
    elbow: ElbowParameters | None = None

    def __post_init__(self) -> None:
        require(bool(self.moving), "moving", "none", "at least one")
