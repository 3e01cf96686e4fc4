"""The surface of a scenario. Lengths in m, angles in degrees."""

import dataclasses as dc
from typing import Union

import numpy as np

from diagrams.scenario.checks import LARGEST_ANGLE, require, require_numbers

_KINDS = ("none", "given", "normal")
_TASKS = ("full", "tool_axis")
_CONVENTIONS = ("zyx", "zyz")


def _require_ends(key: str, values: list[float]) -> None:
    require_numbers(key, values, 2)
    require(values[0] < values[1], key, values, "two numbers that increase")


@dc.dataclass
class _Placed:
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
class _Turned(_Placed):
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
class Plane(_Placed):
    """A rectangle; theta_1 and theta_2 are its coordinates [m], its third axis the normal.

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
class Paraboloid(Plane):
    """A paraboloid of revolution (4.53), (4.54) about its third axis, as a graph.

    Attributes:
        coefficient: Of ``theta_1^2 + theta_2^2`` in its height [1/m].
    """

    coefficient: float = 1.0


@dc.dataclass
class Cylinder(_Turned):
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
class Cone(_Turned):
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
class Sphere(_Turned):
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
class Torus(_Turned):
    """A torus; theta_2 is the angle about its tube.

    Attributes:
        ring_radius: From its axis to the middle of the tube [m].
        tube_radius: [m].
    """

    ring_radius: float = 0.3
    tube_radius: float = 0.1


# the first is what a shape without a tag means
SurfaceShape = Union[Paraboloid, Plane, Cylinder, Cone, Sphere, Torus]  # noqa: UP007


@dc.dataclass
class SurfaceOrientationParameters:
    """Orientation of the tool along a surface.

    Attributes:
        kind: ``none``: position only; ``given``: the same everywhere; ``normal``: that of the
            frame of first tangent, second and normal.
        convention: ``zyx`` (2.7) or ``zyz`` (2.6).
        angles_deg: Euler angles [deg]: of the orientation, or of its turn away from the frame.
        task: ``full``, or ``tool_axis``, whose turn about itself is free.
        tool_axis: Axis in the tool frame, of any length, for ``tool_axis``.
    """

    kind: str = "none"
    convention: str = "zyx"
    angles_deg: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0])
    task: str = "full"
    tool_axis: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])

    def __post_init__(self) -> None:
        for key, values in {"kind": _KINDS, "convention": _CONVENTIONS, "task": _TASKS}.items():
            require(getattr(self, key) in values, key, getattr(self, key), ", ".join(values))
        require_numbers("angles_deg", self.angles_deg, 3)
        good = max(map(abs, self.angles_deg)) <= LARGEST_ANGLE
        allowed = f"3 numbers of at most {LARGEST_ANGLE:g} deg"
        require(good, "angles_deg", self.angles_deg, allowed)
        require_numbers("tool_axis", self.tool_axis, 3)
        require(bool(np.any(self.tool_axis)), "tool_axis", self.tool_axis, "not all zero")


@dc.dataclass
class SurfaceParameters:
    """The surface.

    Attributes:
        shape: Position, one of ``!Paraboloid``, ``!Plane``, ``!Cylinder``, ``!Cone``, ``!Sphere``,
            ``!Torus``.
        orientation: Orientation.
    """

    shape: SurfaceShape = dc.field(default_factory=Paraboloid)
    orientation: SurfaceOrientationParameters = dc.field(
        default_factory=SurfaceOrientationParameters
    )
