"""Parameters of a path whose waypoints arrive while the tool moves."""

from dataclasses import dataclass, field
from typing import Annotated

from pfsc_drake.checks import require
from pfsc_drake.control.law.timed_reference import StreamLimits
from pfsc_drake.yaml.rules import Numbers, Parameters, Positive, Range


@dataclass
class StreamParameters(Parameters):
    """Parameters of the path from waypoints, and of the motion along it.

    Attributes:
        spacing: Least distance of waypoints; closer ones are skipped, and those at more than twice
            the spacing are joined by a straight line [m], 1e-4 to 1.
        through: Whether the path passes through the waypoints, with an error of fourth order in
            their distance; otherwise it is smoother and cuts bends, which suits hand-drawn points.
        least_radius: Least radius of curvature; where the path would bend more sharply, the tool
            comes to rest at the previous waypoint and continues from there [m].
        velocity: Largest speed [m/s].
        acceleration: Largest acceleration along the path [m/s^2].
        normal_acceleration: Largest centripetal acceleration [m/s^2].
        jerk: Largest jerk of the path at constant speed [m/s^3].
        bandwidth: Bandwidth of the lags that make the motion smooth enough for the law [1/s].
        patience: Longest time without a waypoint; then the tool stops at the last one [s].
        lower: Smallest coordinates of waypoints [m], three; empty for no bound.
        upper: Largest coordinates of waypoints [m], three; empty for no bound.
        columns: Number of control points in memory, at least 20.
    """

    spacing: Annotated[float, Range(0.0001, 1.0, "m")] = 0.01
    through: bool = True
    least_radius: Positive = 0.005
    velocity: Positive = 0.3
    acceleration: Positive = 1.5
    normal_acceleration: Positive = 1.5
    jerk: Positive = 30.0
    bandwidth: Positive = 40.0
    patience: Positive = 0.5
    lower: Annotated[list[float], Numbers(3, empty=True)] = field(default_factory=list)
    upper: Annotated[list[float], Numbers(3, empty=True)] = field(default_factory=list)
    columns: Annotated[int, Range(0)] = 48

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.lower and self.upper:
            inside = all(a < b for a, b in zip(self.lower, self.upper, strict=True))
            require(inside, "upper", self.upper, f"more than lower, {self.lower}")

    @property
    def limits(self) -> StreamLimits:
        """Limits of the motion along the path."""
        return StreamLimits(self.velocity, self.acceleration, self.bandwidth)
