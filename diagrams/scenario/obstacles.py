"""Obstacles that cross the path, their sensor, and the waiting of progress for them."""

import dataclasses as dc
from typing import Annotated

from pfsc_drake.control.obstacles.elbow_clearance import ElbowParameters
from pfsc_drake.control.obstacles.watch_parameters import WatchParameters
from pfsc_drake.physics.moving_obstacle import ObstacleParameters, ObstacleSensorParameters
from pfsc_drake.yaml.rules import Count, Parameters


@dc.dataclass
class CrossingParameters(Parameters):
    """Obstacles, for a tool that follows a path or a surface.

    Attributes:
        moving: The obstacles, with their motion.
        sensor: Their sensor.
        watch: Waiting of progress for them.
        elbow: Null-space avoidance by the elbow of a redundant arm; none without the block.
    """

    moving: Annotated[list[ObstacleParameters], Count(1)] = dc.field(
        default_factory=lambda: [ObstacleParameters()]
    )
    sensor: ObstacleSensorParameters = dc.field(default_factory=ObstacleSensorParameters)
    watch: WatchParameters = dc.field(default_factory=WatchParameters)
    elbow: ElbowParameters | None = None
