"""Motions of the regions of a scenario. Lengths in m, angles in degrees."""

import dataclasses as dc
import math
from typing import Annotated

from pfsc_drake.checks import require
from pfsc_drake.control.law.reference import rest_to_rest
from pfsc_drake.control.law.swing import SwingingCourse
from pfsc_drake.geometry.regions.moving import (
    Course,
    CurveCourse,
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

_LARGEST = 10.0  # m: how far a region may move
_LARGEST_DEG = 360.0


@dc.dataclass
class Visiting(Parameters):
    """A way that comes to rest at every one of several points.

    Attributes:
        points: Places to visit [m], of a turn [deg]; where the scenario shows the region is 0.
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
        """Largest distance from where the scenario shows the region [m], or [deg]."""
        return max(map(abs, self.points))

    def course(self, unit: float) -> Course:
        """Return the course in m or rad.

        Args:
            unit: Its unit in m or rad.
        """
        curve = rest_to_rest(
            [unit * point for point in self.points],
            velocity=unit * self.velocity,
            acceleration=unit * self.acceleration,
            dwell=self.dwell,
        )
        return CurveCourse(curve, repeat=self.repeat)


@dc.dataclass
class Swinging(Parameters):
    """A way ``amplitude sin(2 pi frequency (t - begin))`` that begins smoothly.

    Attributes:
        amplitude: [m], of a turn [deg].
        frequency: [Hz].
        begin: Until when it rests [s].
        ramp: Time in which it comes to its full amplitude [s].
    """

    amplitude: Positive = 0.02
    frequency: Annotated[float, Range(1e-4, 100.0, "Hz")] = 0.2
    begin: NotNegative = 0.5
    ramp: Annotated[float, Range(1e-3, 1e3, "s")] = 1.0

    @property
    def extent(self) -> float:
        """Largest distance from where the scenario shows the region [m], or [deg]."""
        return self.amplitude

    def course(self, unit: float) -> Course:
        """Return the course in m or rad.

        Args:
            unit: Its unit in m or rad.
        """
        return SwingingCourse(
            unit * self.amplitude, self.frequency, begin=self.begin, ramp=self.ramp
        )


@dc.dataclass
class Shift(Parameters):
    """A region that moves along a direction.

    Attributes:
        direction: World axes, of any length.
        way: ``!Visiting`` or ``!Swinging`` [m].
    """

    direction: Direction = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])
    way: Visiting | Swinging = dc.field(default_factory=Visiting)

    def __post_init__(self) -> None:
        super().__post_init__()
        far = self.way.extent <= _LARGEST
        require(far, "way", self.way.extent, f"no further than {_LARGEST:g} m")

    def moving(self, region: Region) -> MovingRegion:
        """Return a region that moves so.

        Args:
            region: The region where it is shown.
        """
        return ShiftedRegion(region, self.way.course(1.0), self.direction)


@dc.dataclass
class Turn(Parameters):
    """A region that turns about an axis.

    Attributes:
        axis: World axes, of any length.
        point: On the axis [m].
        way: ``!Visiting`` or ``!Swinging`` [deg].
    """

    axis: Direction = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])
    point: Point = dc.field(default_factory=lambda: [0.0, 0.0, 0.0])
    way: Visiting | Swinging = dc.field(default_factory=Visiting)

    def __post_init__(self) -> None:
        super().__post_init__()
        far = self.way.extent <= _LARGEST_DEG
        require(far, "way", self.way.extent, f"no further than {_LARGEST_DEG:g} deg")

    def moving(self, region: Region) -> MovingRegion:
        """Return a region that moves so.

        Args:
            region: The region where it is shown.
        """
        return TurningRegion(region, self.way.course(math.pi / 180.0), self.point, self.axis)


RegionMotion = Shift | Turn
