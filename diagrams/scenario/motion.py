"""Where a scenario starts and how it moves along."""

import dataclasses as dc

import numpy as np

from diagrams.scenario.checks import (
    require,
    require_not_negative,
    require_numbers,
    require_positive,
)


@dc.dataclass
class ReferenceParameters:
    """Motion along the path, resting at every point.

    Attributes:
        points: Arc lengths to visit [m]; the first is the start.
        velocity: Largest velocity [m/s].
        acceleration: Largest acceleration [m/s^2].
        dwell: Rest before, between and after the moves [s].
    """

    points: list[float] = dc.field(default_factory=lambda: [0.0, 0.1])
    velocity: float = 0.1
    acceleration: float = 1.0
    dwell: float = 0.3

    def __post_init__(self) -> None:
        enough = len(self.points) >= 2 and bool(np.isfinite(self.points).all())
        require(enough, "points", self.points, "two or more finite numbers")
        require_positive("velocity", self.velocity)
        require_positive("acceleration", self.acceleration)
        require_not_negative("dwell", self.dwell)


@dc.dataclass
class StartParameters:
    """Where the tool is at the start, at rest.

    Attributes:
        offset: Transversal coordinates [m] beside the first point of the reference.
        rotation_deg: ZYX angles [deg] away from the path's orientation.
        posture_deg: Joint angles [deg] near the start pose (m for prismatic joints); they
            choose the branch of the inverse kinematics.
    """

    offset: list[float] = dc.field(default_factory=lambda: [0.0, 0.0])
    rotation_deg: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0])
    posture_deg: list[float] = dc.field(default_factory=list)

    def __post_init__(self) -> None:
        require_numbers("offset", self.offset, 2)
        require_numbers("rotation_deg", self.rotation_deg, 3)
        finite = bool(np.isfinite(self.posture_deg).all())
        require(finite, "posture_deg", self.posture_deg, "finite numbers")
