"""What a controller is told of obstacles, and how it keeps away from them."""

import dataclasses as dc

from pfsc_drake.checks import require_between, require_not_negative, require_positive


@dc.dataclass
class WatchParameters:
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

    margin: float = 0.15
    largest_speed: float = 1.6
    largest_acceleration: float | None = None
    uncertainty: float = 0.03
    velocity_uncertainty: float = 0.3
    latency: float = 0.1
    spread: float = 0.05
    retreat: float = 0.0
    side: float = 0.05
    horizon: float = 2.5
    smoothing: float = 0.1
    resting_speed: float = 0.025
    arm_radius: float = 0.1
    reserve: float = 0.3

    def __post_init__(self) -> None:
        for key in ("margin", "uncertainty", "velocity_uncertainty", "spread", "side"):
            require_not_negative(key, getattr(self, key))
        for key in ("resting_speed", "arm_radius"):
            require_positive(key, getattr(self, key))
        require_between("largest_speed", self.largest_speed, 0.01, 100.0, "m/s")
        if self.largest_acceleration is not None:
            require_between("largest_acceleration", self.largest_acceleration, 0.1, 1e3, "m/s^2")
        require_between("retreat", self.retreat, 0.0, 1.0, "of the planned pace")
        require_between("latency", self.latency, 0.0, 10.0, "s")
        require_between("horizon", self.horizon, 0.1, 60.0, "s")
        require_between("smoothing", self.smoothing, 1e-3, 10.0, "s")
        require_between("reserve", self.reserve, 0.0, 0.99, "of the torques")
