"""Motions of the regions of a scenario. Lengths in m, angles in degrees."""

import dataclasses as dc
import math
from typing import Annotated

from pfsc_drake.checks import require
from pfsc_drake.control.law.reference import rest_to_rest
from pfsc_drake.control.law.swing import OscillatingMotion
from pfsc_drake.geometry.regions.moving import (
    CurveMotion,
    Motion,
    MovingRegion,
    ShiftedRegion,
    TurningRegion,
)
from pfsc_drake.geometry.regions.region import Region
from pfsc_drake.yaml.rules import (
    Direction,
    NotNegative,
    Numbers,
    Parameters,
    Point,
    Positive,
    Range,
)

_LARGEST = 10.0  # m, displacement of a region
_LARGEST_DEG = 360.0


@dc.dataclass
class Visiting(Parameters):
    """Motion through several points, at rest at each.

    Attributes:
        points: Points to visit [m], of a turn [deg]; 0 is the pose of the region in the scenario.
        velocity: Largest velocity [m/s], of a turn [deg/s].
        acceleration: Largest acceleration [m/s^2], of a turn [deg/s^2].
        dwell: Rest before, between and after the moves [s].
        repeat: Whether it begins again at the end; the last point is then the first.
    """

    points: Annotated[list[float], Numbers(fewest=2, words="two or more finite numbers")] = (
        dc.field(default_factory=lambda: [0.0, 0.1, 0.0])
    )
    velocity: Positive = 0.05
    acceleration: Positive = 0.5
    dwell: NotNegative = 0.5
    repeat: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        back = not self.repeat or self.points[-1] == self.points[0]
        require(back, "points", self.points, "the last as the first, with repeat: true")

    @property
    def extent(self) -> float:
        """Largest distance from the pose of the region in the scenario [m], or [deg]."""
        return max(map(abs, self.points))

    def motion(self, unit: float) -> Motion:
        """Return the motion in m or rad.

        Args:
            unit: Its unit in m or rad.
        """
        curve = rest_to_rest(
            [unit * point for point in self.points],
            velocity=unit * self.velocity,
            acceleration=unit * self.acceleration,
            dwell=self.dwell,
        )
        return CurveMotion(curve, repeat=self.repeat)


@dc.dataclass
class Swinging(Parameters):
    """Oscillation ``amplitude sin(2 pi frequency (t - begin))`` with a smooth begin.

    Attributes:
        amplitude: Amplitude [m], of a turn [deg].
        frequency: Frequency [Hz].
        begin: Time of the begin [s]; before, the region rests.
        ramp: Time from rest to the full amplitude [s].
    """

    amplitude: Positive = 0.02
    frequency: Annotated[float, Range(1e-4, 100.0, "Hz")] = 0.2
    begin: NotNegative = 0.5
    ramp: Annotated[float, Range(1e-3, 1e3, "s")] = 1.0

    @property
    def extent(self) -> float:
        """Largest distance from the pose of the region in the scenario [m], or [deg]."""
        return self.amplitude

    def motion(self, unit: float) -> Motion:
        """Return the motion in m or rad.

        Args:
            unit: Its unit in m or rad.
        """
        return OscillatingMotion(
            unit * self.amplitude, self.frequency, begin=self.begin, ramp=self.ramp
        )


@dc.dataclass
class Shift(Parameters):
    """A region that moves along a direction.

    Attributes:
        direction: Direction, world axes, of any length.
        way: Motion along it, ``!Visiting`` or ``!Swinging`` [m].
    """

    direction: Direction = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])
    way: Visiting | Swinging = dc.field(default_factory=Visiting)

    def __post_init__(self) -> None:
        super().__post_init__()
        far = self.way.extent <= _LARGEST
        require(far, "way", self.way.extent, f"no further than {_LARGEST:g} m")

    def moving(self, region: Region) -> MovingRegion:
        """Return a region with this motion.

        Args:
            region: The region in its pose in the scenario.
        """
        return ShiftedRegion(region, self.way.motion(1.0), self.direction)


@dc.dataclass
class Turn(Parameters):
    """A region that turns about an axis.

    Attributes:
        axis: Direction of the axis, world axes, of any length.
        point: A point of the axis [m].
        way: Motion about it, ``!Visiting`` or ``!Swinging`` [deg].
    """

    axis: Direction = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])
    point: Point = dc.field(default_factory=lambda: [0.0, 0.0, 0.0])
    way: Visiting | Swinging = dc.field(default_factory=Visiting)

    def __post_init__(self) -> None:
        super().__post_init__()
        far = self.way.extent <= _LARGEST_DEG
        require(far, "way", self.way.extent, f"no further than {_LARGEST_DEG:g} deg")

    def moving(self, region: Region) -> MovingRegion:
        """Return a region with this motion.

        Args:
            region: The region in its pose in the scenario.
        """
        return TurningRegion(region, self.way.motion(math.pi / 180.0), self.point, self.axis)


RegionMotion = Shift | Turn
