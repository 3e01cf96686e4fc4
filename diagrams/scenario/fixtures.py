"""Virtual fixtures of a scenario: regions that a tool led by hand may not enter."""

import dataclasses as dc
from typing import Annotated, Union

from diagrams.scenario.checks import (
    Direction,
    Point,
    require,
    require_length,
    require_numbers,
)
from diagrams.scenario.path import BentLemniscate, Circle, Intersection, Line, Waypoints
from diagrams.scenario.surface import Extruded, Fitted, Revolved, SurfaceOrientationParameters
from diagrams.scenario.surface_shapes import (
    Cone,
    Cylinder,
    Paraboloid,
    Placed,
    Plane,
    Sphere,
    Torus,
    Turned,
)
from pfsc_drake.control.fixtures.guides import MOST_GUIDES, REACH, STIFFNESS
from pfsc_drake.following.options.follower import FixtureOptions
from pfsc_drake.yaml.fields import equal
from pfsc_drake.yaml.rules import Count, NotNegative, Numbers, OneOf, Parameters, Positive, Range

_SIDES, _FACES = ("inside", "outside"), ("above", "below")
_STIFFNESS = (1.0, 1e6)  # N/m
_LARGEST = 10.0  # m: how far a region may move
_LARGEST_DEG = 360.0


@dc.dataclass
class Box(Placed):
    """A box, as an obstacle; its origin is its middle.

    Attributes:
        size: Along its three axes [m]; one number for a cube.
    """

    size: list[float] = dc.field(default_factory=lambda: [0.1, 0.1, 0.1], metadata=equal(3))

    def __post_init__(self) -> None:
        super().__post_init__()
        require_numbers("size", self.size, 3)
        for length in self.size:
            require_length("size", length)


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


# the first is what a shape without a tag means
RegionShape = Union[  # noqa: UP007
    Plane, Box, Paraboloid, Cylinder, Cone, Sphere, Torus, Fitted, Revolved, Extruded
]


@dc.dataclass
class RegionParameters(Parameters):
    """A surface that the tool must not cross, and the side on which it may be.

    Planes, cylinders, cones and paraboloids have no ends, whatever part of them the shape tells;
    nor have extruded profiles and the open ones of surfaces of revolution, which go on straight.
    A fitted surface ends at its border, and beside it is no region.

    Attributes:
        shape: ``!Plane``, ``!Box``, ``!Paraboloid``, ``!Cylinder``, ``!Cone``, ``!Sphere``,
            ``!Torus``, or from a file ``!Fitted``, ``!Revolved``, ``!Extruded``; without a part of
            a turn, ``angles_deg``.
        admissible: ``inside`` or ``outside`` of what encloses something; ``above``, on the side of
            the normal, or ``below`` of a plane, a fitted surface and open profiles; empty for
            ``outside``, or ``above``.
        motion: ``!Shift`` or ``!Turn``; null for a region at rest.
        stiffness: Stiffness of a soft region, that pushes back by so much [N/m]; null for a hard
            one.
    """

    shape: RegionShape = dc.field(default_factory=Plane)
    admissible: str = ""
    motion: Shift | Turn | None = None
    stiffness: Annotated[float, Range(*_STIFFNESS, "N/m, or null")] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        kind = type(self.shape).__name__
        sides = _SIDES if encloses(self.shape) else _FACES
        if isinstance(self.shape, Box):
            allowed = "outside of a !Box; for its inside a !Plane at each of its sides"
            require(self.admissible in ("", "outside"), "admissible", self.admissible, allowed)
        good = self.admissible in ("", *sides)
        require(good, "admissible", self.admissible, f"{' or '.join(sides)} of this !{kind}")
        if isinstance(self.shape, Turned):
            whole = not self.shape.angles_deg
            allowed = "empty: a region goes all the way round"
            require(whole, "shape.angles_deg", self.shape.angles_deg, allowed)

    @property
    def inside(self) -> bool:
        """Whether what is enclosed is admissible, or what is below."""
        return self.admissible in ("inside", "below")


def encloses(shape: RegionShape) -> bool:
    """Whether a surface has an inside."""
    if isinstance(shape, Revolved | Extruded):
        return shape.closed
    if isinstance(shape, Fitted):
        return all(shape.closed)
    return not isinstance(shape, Plane)


# the first is what a shape without a tag means
GuideShape = Union[Waypoints, BentLemniscate, Circle, Line, Intersection]  # noqa: UP007


@dc.dataclass
class GuideParameters(Parameters):
    """A path that attracts the tool, next to it like a spring and from its reach on not at all.

    See :class:`~pfsc_drake.control.fixtures.guides.Guide`.

    Attributes:
        shape: ``!Line``, ``!Circle``, ``!Waypoints``, ``!Intersection`` or ``!BentLemniscate``.
        stiffness: Stiffness next to the path [N/m].
        reach: Distance from which on it does not attract [m].
    """

    shape: GuideShape = dc.field(default_factory=Line)
    stiffness: Annotated[float, Range(*STIFFNESS, "N/m")] = 2000.0
    reach: Annotated[float, Range(*REACH, "m")] = 0.06


_START = ("refuse", "move_out")


@dc.dataclass
class FixtureParameters(FixtureOptions):
    """What limits a tool that is led through space, ``controller.manifold: space``.

    Mass and damping of the free motion are those of ``compliance.tangential``. Further attributes
    are those of :class:`FixtureOptions`.

    Attributes:
        regions: Where the tool may not go.
        guides: Paths that attract it.
        orientation: That the tool keeps.
        start_inside: Start inside of a region that the tool starts in: ``refuse``, or ``move_out``
            slowly.
        servo_lag: ``tau`` [s] of the velocity servos as it is believed; negative for the inverse
            of ``servo.bandwidth``.
        bound: How deep the tool may be in a hard region [m]; a run in which it was deeper says so
            and ends with status 3.
    """

    regions: list[RegionParameters] = dc.field(default_factory=list)
    guides: Annotated[
        list[GuideParameters], Count(0, MOST_GUIDES, words=f"{MOST_GUIDES} or fewer")
    ] = dc.field(default_factory=list)
    orientation: SurfaceOrientationParameters = dc.field(
        default_factory=SurfaceOrientationParameters
    )
    start_inside: Annotated[str, OneOf(_START)] = "refuse"
    servo_lag: Annotated[float, Range(most=0.1, unit="s", below=True)] = -1.0
    bound: Annotated[float, Range(1e-6, 0.1, "m")] = 0.5e-3

    @property
    def names(self) -> list[str]:
        """What the regions are called: kind of shape and number, from 1 on."""
        kinds = (type(region.shape).__name__.lower() for region in self.regions)
        return [f"{kind}_{number}" for number, kind in enumerate(kinds, start=1)]

    @property
    def guide_names(self) -> list[str]:
        """What the guides are called, likewise."""
        kinds = (type(guide.shape).__name__.lower() for guide in self.guides)
        return [f"{kind}_{number}" for number, kind in enumerate(kinds, start=1)]

    def lag_behind(self, bandwidth: float) -> float:
        """Return ``tau`` [s] of the servos as it is believed.

        Args:
            bandwidth: Bandwidth of the servos as the scenario has it [rad/s].
        """
        return self.servo_lag if self.servo_lag >= 0.0 else 1.0 / bandwidth

    def __post_init__(self) -> None:
        super().__post_init__()
        kind = self.orientation.kind
        require(kind != "normal", "orientation.kind", kind, "none, given")
