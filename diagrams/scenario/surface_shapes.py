"""Shapes of surfaces that a scenario gives by numbers. Lengths in m, angles in degrees."""

import dataclasses as dc

from diagrams.scenario.checks import require, require_numbers


def _require_ends(key: str, values: list[float]) -> None:
    require_numbers(key, values, 2)
    require(values[0] < values[1], key, values, "two numbers that increase")


@dc.dataclass
class Placed:
    """Where a surface stands.

    Attributes:
        origin: A point of it, or on its axis [m].
        axis: Direction of its third axis, of any length.
        start: Direction to which its first axis leans.
    """

    origin: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0])
    axis: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])
    start: list[float] = dc.field(default_factory=lambda: [1.0, 0.0, 0.0])

    def __post_init__(self) -> None:
        for key in ("origin", "axis", "start"):
            require_numbers(key, getattr(self, key), 3)


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
            _require_ends("angles_deg", self.angles_deg)


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
        coefficient: Of ``theta_1^2 + theta_2^2`` in its height [1/m].
    """

    coefficient: float = 1.0


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
        _require_ends("distances", self.distances)


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
        _require_ends("latitudes_deg", self.latitudes_deg)


@dc.dataclass
class Torus(Turned):
    """A torus; theta_2 is the angle about its tube.

    Attributes:
        ring_radius: From its axis to the middle of the tube [m].
        tube_radius: [m].
    """

    ring_radius: float = 0.3
    tube_radius: float = 0.1
