"""Parameters of obstacle monitoring: uncertainties, margins, waiting and retreat."""

import dataclasses as dc
from typing import Annotated

from pfsc_drake.yaml.rules import NotNegative, Parameters, Positive, Range


@dc.dataclass
class WatchParameters(Parameters):
    """Parameters of a motion that waits for obstacles.

    Attributes:
        margin: Least distance between arm and obstacles while the arm moves [m].
        largest_speed: Largest speed of an obstacle, 1.6 m/s for a person who walks (ISO 13855)
            [m/s].
        largest_acceleration: Largest acceleration of an obstacle [m/s^2]; null if unknown, then an
            obstacle may reverse immediately.
        uncertainty: Largest error of a measured position [m].
        velocity_uncertainty: Largest error of a measured velocity [m/s].
        latency: Largest age of a measured position when it is used [s].
        spread: Growth rate of the uncertainty radius of a predicted position [m/s].
        retreat: Speed scaling at which the tool retreats from predicted obstacles, up to 1; 0 for
            never.
        side: Distance in addition to the margin that a waiting point needs [m].
        horizon: Prediction horizon [s].
        smoothing: Time constant of the filter on measured velocities [s].
        resting_speed: Speed of the tool that counts as rest [m/s].
        arm_radius: Radius of the capsules along the links that enclose the arm [m].
        reserve: Share of the drives' torques that stops and restarts do not use, from 0 to below 1.
    """

    margin: NotNegative = 0.15
    largest_speed: Annotated[float, Range(0.01, 100.0, "m/s")] = 1.6
    largest_acceleration: Annotated[float, Range(0.1, 1e3, "m/s^2")] | None = None
    uncertainty: NotNegative = 0.03
    velocity_uncertainty: NotNegative = 0.3
    latency: Annotated[float, Range(0.0, 10.0, "s")] = 0.1
    spread: NotNegative = 0.05
    retreat: Annotated[float, Range(0.0, 1.0, "of the planned speed")] = 0.0
    side: NotNegative = 0.05
    horizon: Annotated[float, Range(0.1, 60.0, "s")] = 2.5
    smoothing: Annotated[float, Range(0.001, 10.0, "s")] = 0.1
    resting_speed: Positive = 0.025
    arm_radius: Positive = 0.1
    reserve: Annotated[float, Range(0.0, 0.99, "of the torques")] = 0.3
