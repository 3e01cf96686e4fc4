"""What a controller is told of obstacles, and how it keeps away from them."""

import dataclasses as dc
from typing import Annotated

from pfsc_drake.yaml.rules import NotNegative, Parameters, Positive, Range


@dc.dataclass
class WatchParameters(Parameters):
    """How progress on a path waits for obstacles.

    Attributes:
        margin: Least distance between arm and obstacles while the arm moves [m].
        largest_speed: Largest speed of an obstacle, 1.6 m/s for a person who walks (ISO 13855)
            [m/s].
        largest_acceleration: Largest acceleration of an obstacle [m/s^2]; null if it is not known,
            then it may turn round at once.
        uncertainty: By how much a measured position may be wrong [m].
        velocity_uncertainty: By how much a measured velocity may be wrong [m/s].
        latency: How old a measured position is at most when it is used [s].
        spread: By how much an obstacle may be beside where it is expected, for each second ahead
            [m/s].
        retreat: Pace, as a share of the planned one, at which it goes back from where somebody is
            expected, up to 1; 0 for never.
        side: Side room: distance beside the margin that a place needs to wait there [m].
        horizon: How far obstacles are foreseen [s].
        smoothing: Time constant by which measured velocities are smoothed [s].
        resting_speed: Speed of the tool that counts as rest [m/s].
        arm_radius: Radius of the capsules along the links within which the arm is [m].
        reserve: Share of the drives' torques that waiting and setting off again leave, from 0 to
            below 1.
    """

    margin: NotNegative = 0.15
    largest_speed: Annotated[float, Range(0.01, 100.0, "m/s")] = 1.6
    largest_acceleration: Annotated[float, Range(0.1, 1e3, "m/s^2")] | None = None
    uncertainty: NotNegative = 0.03
    velocity_uncertainty: NotNegative = 0.3
    latency: Annotated[float, Range(0.0, 10.0, "s")] = 0.1
    spread: NotNegative = 0.05
    retreat: Annotated[float, Range(0.0, 1.0, "of the planned pace")] = 0.0
    side: NotNegative = 0.05
    horizon: Annotated[float, Range(0.1, 60.0, "s")] = 2.5
    smoothing: Annotated[float, Range(0.001, 10.0, "s")] = 0.1
    resting_speed: Positive = 0.025
    arm_radius: Positive = 0.1
    reserve: Annotated[float, Range(0.0, 0.99, "of the torques")] = 0.3
