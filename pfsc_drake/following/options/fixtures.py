"""How a tool that is led by hand is kept out of regions."""

import dataclasses as dc

from pfsc_drake.checks import require_between, require_not_negative
from pfsc_drake.control.fixtures.parameters import GuidanceParameters, RobotLimitParameters


@dc.dataclass
class FixtureOptions:
    """What limits a tool that is led through space.

    Attributes:
        guidance: How it is kept out of regions.
        limits: How far it follows a hand to where the robot itself cannot go on.
        smoothing: Time constant [s] of each of the r - 1 lags that make the reference smooth
            enough for laws that give torques.
        looks: Most distances that are computed at a tick beside those of regions that are near;
            0 for as many as are due.
    """

    guidance: GuidanceParameters = dc.field(default_factory=GuidanceParameters)
    limits: RobotLimitParameters = dc.field(default_factory=RobotLimitParameters)
    smoothing: float = 0.003
    looks: int = 0

    def __post_init__(self) -> None:
        require_between("smoothing", self.smoothing, 1e-3, 0.1, "s")
        require_not_negative("looks", self.looks)
