"""What can be chosen of a path whose way points come while the tool moves."""

from dataclasses import dataclass, field

import numpy as np

from pfsc_drake.checks import require, require_between, require_not_negative, require_positive
from pfsc_drake.control.law.timed_reference import StreamLimits


@dataclass
class StreamParameters:
    """How way points become a path, and how fast it is followed.

    Attributes:
        spacing: Way points nearer to the one before are left out; those more than twice as far
            from it are joined to it by a straight line [m], 1e-4 to 1.
        through: Whether the path leads by the way points, with an error of the fourth order of
            their distance; otherwise it is smoother and cuts bends, which suits points by hand.
        least_radius: Where the path would bend more sharply, the tool comes to rest at the point
            before and goes on from there [m].
        velocity: Largest speed [m/s].
        acceleration: Largest acceleration along the path [m/s^2].
        normal_acceleration: Largest acceleration across it, of the bends [m/s^2].
        jerk: Largest jerk of the path at constant speed [m/s^3].
        bandwidth: Bandwidth of the lags that make the motion smooth enough for the law [1/s].
        patience: Without a way point for so long the tool goes to the last one, to rest there [s].
        lower: Smallest coordinates of way points [m], three; empty for no bound.
        upper: Largest coordinates of way points [m], three; empty for no bound.
        columns: How many control points are known at once, at least 20.
    """

    spacing: float = 0.01
    through: bool = True
    least_radius: float = 0.005
    velocity: float = 0.3
    acceleration: float = 1.5
    normal_acceleration: float = 1.5
    jerk: float = 30.0
    bandwidth: float = 40.0
    patience: float = 0.5
    lower: list[float] = field(default_factory=list)
    upper: list[float] = field(default_factory=list)
    columns: int = 48

    def __post_init__(self) -> None:
        require_between("spacing", self.spacing, 1e-4, 1.0, "m")
        for key in ("least_radius", "normal_acceleration", "jerk", "patience"):
            require_positive(key, getattr(self, key))
        for key in ("velocity", "acceleration", "bandwidth"):
            require_positive(key, getattr(self, key))
        require_not_negative("columns", self.columns)
        for key in ("lower", "upper"):
            values = getattr(self, key)
            good = len(values) in (0, 3) and bool(np.isfinite(values).all())
            require(good, key, values, "three numbers, or none")
        if self.lower and self.upper:
            inside = all(a < b for a, b in zip(self.lower, self.upper, strict=True))
            require(inside, "upper", self.upper, f"more than lower, {self.lower}")

    @property
    def limits(self) -> StreamLimits:
        """How fast it goes along the path."""
        return StreamLimits(self.velocity, self.acceleration, self.bandwidth)
