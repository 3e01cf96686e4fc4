"""Obstacles that move by themselves, and their sensor."""

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import ConstantVectorSource

from diagrams.scenario.obstacles import CrossingParameters
from pfsc_drake.checks import require_whole_ticks
from pfsc_drake.physics.moving_obstacle import MovingObstacles, ObstacleSensor
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.physics.sensor_noise import SensorNoise

_MOST_TICKS = 1000
# source of the reported obstacles of a robot in another process
REPORTED = "reported_obstacles"


def add_reported_obstacles(
    builder: DiagramBuilder, crossing: CrossingParameters, period: float
) -> dict[str, OutputPort]:
    """Add a source of obstacle states that another process reports.

    Args:
        builder: Builder of the diagram.
        crossing: The obstacles.
        period: Sampling time [s]; not used.

    Returns:
        The signals of :func:`add_obstacles`, which are equal here.
    """
    nothing = np.full(6 * len(crossing.moving), np.nan)
    state = builder.AddNamedSystem(REPORTED, ConstantVectorSource(nothing)).get_output_port()
    return {"obstacles": state, "obstacles_measured": state}


def add_obstacles(
    builder: DiagramBuilder, crossing: CrossingParameters, period: float
) -> dict[str, OutputPort]:
    """Add obstacles and their sensor.

    Args:
        builder: Builder of the diagram.
        crossing: The obstacles and their sensor.
        period: Sampling time [s].

    Returns:
        ``obstacles``, the actual states, and ``obstacles_measured``, each (6K,) [m, m/s].

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
