"""Obstacles that move by themselves, and what is measured of them."""

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import ConstantVectorSource

from diagrams.scenario.obstacles import CrossingParameters
from pfsc_drake.checks import require_whole_ticks
from pfsc_drake.physics.moving_obstacle import MovingObstacles, ObstacleSensor
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.physics.sensor_noise import SensorNoise

_MOST_TICKS = 1000
# source of what is told of them where the robot stands elsewhere
TOLD = "obstacles_told"


def add_told_obstacles(
    builder: DiagramBuilder, crossing: CrossingParameters, period: float
) -> dict[str, OutputPort]:
    """Add what others tell of obstacles, of which nothing else is known.

    Args:
        builder: Builder of the diagram.
        crossing: What they look like.
        period: Sampling time [s], of no matter here.

    Returns:
        As :func:`add_obstacles`, both the same.
    """
    nothing = np.full(6 * len(crossing.moving), np.nan)
    told = builder.AddNamedSystem(TOLD, ConstantVectorSource(nothing)).get_output_port()
    return {"obstacles": told, "obstacles_measured": told}


def add_obstacles(
    builder: DiagramBuilder, crossing: CrossingParameters, period: float
) -> dict[str, OutputPort]:
    """Add obstacles and their sensor.

    Args:
        builder: Builder of the diagram.
        crossing: What moves, and how it is measured.
        period: Sampling time [s].

    Returns:
        ``obstacles`` as they are, and ``obstacles_measured``, each (6K,) [m, m/s].

    Raises:
        InputError: If the sensor does not suit the sampling time.
    """
    count, sensor = len(crossing.moving), crossing.sensor
    every = require_whole_ticks("obstacles.sensor.period", sensor.period, period, _MOST_TICKS)
    late = require_whole_ticks("obstacles.sensor.delay", sensor.delay, period, _MOST_TICKS)
    moving = builder.AddNamedSystem(
        "moving_obstacles", BlockSystem(MovingObstacles(crossing.moving, period), period)
    )
    deviation = sensor.deviation(count)
    measures = builder.AddNamedSystem(
        "obstacle_sensor", BlockSystem(ObstacleSensor(count, every, late, deviation), period)
    )
    state = moving.GetOutputPort("state")
    builder.Connect(state, measures.GetInputPort("state"))
    if deviation.any():
        noise = builder.AddNamedSystem(
            "obstacle_noise", SensorNoise(deviation, sensor.seed, period)
        )
        builder.Connect(noise.get_output_port(), measures.GetInputPort("noise"))
    return {"obstacles": state, "obstacles_measured": measures.GetOutputPort("obstacles")}
