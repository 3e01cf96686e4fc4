"""How a path is taught."""

import dataclasses as dc
import math

from diagrams.scenario.checks import require_between


@dc.dataclass(frozen=True)
class TeachingOptions:
    """How waypoints are picked, how closely a path fits them, and how fast it is followed.

    Attributes:
        spacing: Of the waypoints [m].
        angle_deg: Turn after which a waypoint is taken before that [deg].
        closed: Whether the tool was led back to where it began.
        tolerance: How far the path may be from a waypoint [m].
        tolerance_deg: The same of the orientation [deg].
        velocity: Along the path [m/s].
        acceleration: Along the path [m/s^2].
    """

    spacing: float = 0.01
    angle_deg: float = 3.0
    closed: bool = False
    tolerance: float = 2e-3
    tolerance_deg: float = 1.0
    velocity: float = 0.1
    acceleration: float = 0.5

    def __post_init__(self) -> None:
        require_between("--spacing", self.spacing, 1e-4, 1.0, "m")
        require_between("--angle", self.angle_deg, 0.1, 20.0, "deg")
        require_between("--tolerance", self.tolerance, 1e-6, 1.0, "m")
        require_between("--tolerance-deg", self.tolerance_deg, 1e-3, 90.0, "deg")
        require_between("--velocity", self.velocity, 1e-6, 1e3, "m/s")
        require_between("--acceleration", self.acceleration, 1e-6, 1e6, "m/s^2")

    @property
    def angle(self) -> float:
        """The angle [rad]."""
        return math.radians(self.angle_deg)
