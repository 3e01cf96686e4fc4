"""Obstacles that cross the path, how they are measured, and how progress waits for them."""

import dataclasses as dc
from typing import Annotated

from pfsc_drake.control.obstacles.elbow_room import ElbowParameters
from pfsc_drake.control.obstacles.watch_parameters import WatchParameters
from pfsc_drake.physics.moving_obstacle import ObstacleParameters, ObstacleSensorParameters
from pfsc_drake.yaml.rules import Count, Parameters


@dc.dataclass
class CrossingParameters(Parameters):
    """Obstacles, for a tool that follows a path or a surface.

    Attributes:
        moving: What moves, and where.
        sensor: What measures it.
        watch: How progress waits for it.
        elbow: How the elbow of an arm with joints to spare gives way; it does not without.
    """

    moving: Annotated[list[ObstacleParameters], Count(1)] = dc.field(
        default_factory=lambda: [ObstacleParameters()]
    )
    sensor: ObstacleSensorParameters = dc.field(default_factory=ObstacleSensorParameters)
    watch: WatchParameters = dc.field(default_factory=WatchParameters)
    elbow: ElbowParameters | None = None
