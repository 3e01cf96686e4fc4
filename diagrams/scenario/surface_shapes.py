"""Shapes of surfaces that a scenario gives by numbers. Lengths in m, angles in degrees."""

import dataclasses as dc

import numpy as np

from diagrams.scenario.checks import (
    require,
    require_direction,
    require_length,
    require_numbers,
    require_place,
)
from pfsc_drake.geometry.curves.curve import FARTHEST
from pfsc_drake.geometry.surfaces.surface import rotation_from_axes

_LARGEST_TURN = 720.0  # deg
_MOST_BENT = 1e4  # 1/m


def _require_ends(key: str, values: list[float]) -> None:
    """Refuse what are no ends of a length [m]."""
    require_numbers(key, values, 2)
    good = -FARTHEST <= values[0] < values[1] <= FARTHEST
    require(good, key, values, f"two numbers that increase, of at most {FARTHEST:g} m")


@dc.dataclass
class Placed:
    """Where a surface stands.

    Attributes:
        origin: A point of it, or on its axis [m].
        axis: Direction of its third axis, of any length.
        start: Direction to which its first axis leans; empty for x_0, or y_0 if the third axis is
            along x_0.
    """

    origin: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0])
    axis: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])
    start: list[float] = dc.field(default_factory=list)

    @property
    def rotation(self) -> np.ndarray:
        """Its axes as columns, shape (3, 3).

        Raises:
            InputError: If ``start`` is along ``axis``.
        """
        return rotation_from_axes(self.axis, self.start or None)

    def __post_init__(self) -> None:
        require_place("origin", self.origin)
        require_direction("axis", self.axis)
        if self.start:
            require_direction("start", self.start)


@dc.dataclass
class Turned(Placed):
    """A surface of revolution; theta_1 is the angle about its axis.

    Attributes:
        angles_deg: First and last theta_1 [deg]; empty for a whole turn, which is closed.
        inward: Whether the normal points to the axis.
    """

    angles_deg: list[float] = dc.field(default_factory=list)
    inward: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.angles_deg:
            require_numbers("angles_deg", self.angles_deg, 2)
            first, last = self.angles_deg
            good = -_LARGEST_TURN <= first < last <= _LARGEST_TURN
            allowed = f"two numbers that increase, of at most {_LARGEST_TURN:g} deg"
            require(good, "angles_deg", self.angles_deg, allowed)


@dc.dataclass
class OverRectangle(Placed):
    """A surface over a rectangle; theta_1 and theta_2 are its coordinates [m].

    Attributes:
        first: First and last theta_1 [m].
        second: First and last theta_2 [m].
    """

    first: list[float] = dc.field(default_factory=lambda: [-0.2, 0.2])
    second: list[float] = dc.field(default_factory=lambda: [-0.2, 0.2])

    def __post_init__(self) -> None:
        super().__post_init__()
        for key in ("first", "second"):
            _require_ends(key, getattr(self, key))


@dc.dataclass
class Plane(OverRectangle):
    """A rectangle; its third axis is the normal."""


@dc.dataclass
class Paraboloid(OverRectangle):
    """A paraboloid of revolution (4.53), (4.54) about its third axis, as a graph.

    Attributes:
        coefficient: Coefficient of ``theta_1^2 + theta_2^2`` in its height [1/m].
    """

    coefficient: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        good = abs(self.coefficient) <= _MOST_BENT
        require(good, "coefficient", self.coefficient, f"a number of at most {_MOST_BENT:g} 1/m")


@dc.dataclass
class Cylinder(Turned):
    """A cylinder (4.50); theta_2 is the height along its axis.

    Attributes:
        radius: [m].
        heights: First and last theta_2 [m].
    """

    radius: float = 0.1
    heights: list[float] = dc.field(default_factory=lambda: [-0.2, 0.2])

    def __post_init__(self) -> None:
        super().__post_init__()
        require_length("radius", self.radius)
        _require_ends("heights", self.heights)


@dc.dataclass
class Cone(Turned):
    """A cone whose apex is its origin; theta_2 is the distance from it along the surface.

    Attributes:
        opening_deg: Angle between axis and surface [deg].
        distances: First and last theta_2 [m], positive.
    """

    opening_deg: float = 30.0
    distances: list[float] = dc.field(default_factory=lambda: [0.1, 0.4])

    def __post_init__(self) -> None:
        super().__post_init__()
        allowed = "above 0 and below 90 deg"
        require(0.0 < self.opening_deg < 90.0, "opening_deg", self.opening_deg, allowed)
        _require_ends("distances", self.distances)
        allowed = "positive numbers of m: a cone has no normal at its apex"
        require(self.distances[0] > 0.0, "distances", self.distances, allowed)


@dc.dataclass
class Sphere(Turned):
    """A part of a sphere about its origin; theta_2 is the latitude.

    Attributes:
        radius: [m].
        latitudes_deg: First and last theta_2 [deg], without the poles.
    """

    radius: float = 0.2
    latitudes_deg: list[float] = dc.field(default_factory=lambda: [-60.0, 60.0])

    def __post_init__(self) -> None:
        super().__post_init__()
        require_length("radius", self.radius)
        require_numbers("latitudes_deg", self.latitudes_deg, 2)
        good = -90.0 < self.latitudes_deg[0] < self.latitudes_deg[1] < 90.0
        allowed = (
            "two numbers that increase between -90 and 90 deg, without the poles, where longitudes "
            "are undefined; turn axis to have a pole elsewhere"
        )
        require(good, "latitudes_deg", self.latitudes_deg, allowed)


@dc.dataclass
class Torus(Turned):
    """A torus; theta_2 is the angle about its tube.

    Attributes:
        ring_radius: From its axis to the middle of the tube [m].
        tube_radius: [m].
    """

    ring_radius: float = 0.3
    tube_radius: float = 0.1

    def __post_init__(self) -> None:
        super().__post_init__()
        for key in ("ring_radius", "tube_radius"):
            require_length(key, getattr(self, key))
        allowed = f"more than tube_radius = {self.tube_radius:g} m"
        require(self.ring_radius > self.tube_radius, "ring_radius", self.ring_radius, allowed)
