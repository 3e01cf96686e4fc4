"""Virtual fixtures of a scenario: regions that a hand-guided tool may not enter."""

import dataclasses as dc
from typing import Annotated

from diagrams.scenario.manifolds import GuideShape
from diagrams.scenario.region_motion import RegionMotion
from pfsc_drake.checks import require
from pfsc_drake.control.fixtures.guides import MOST_GUIDES, REACH, STIFFNESS
from pfsc_drake.controller.options.follower_options import FixtureOptions
from pfsc_drake.geometry.shapes.path_shapes import Line
from pfsc_drake.geometry.shapes.plane import Plane
from pfsc_drake.geometry.shapes.surface_list import RegionShape
from pfsc_drake.geometry.shapes.tool_orientation import SurfaceOrientationParameters
from pfsc_drake.yaml.rules import Count, OneOf, Parameters, Range

_STIFFNESS = (1.0, 1e6)  # N/m


@dc.dataclass
class RegionParameters(Parameters):
    """A surface that the tool must not cross, with its admissible side.

    Planes, cylinders, cones and paraboloids are unbounded, also if the shape describes only a part
    of them; so are extruded profiles and open profiles of surfaces of revolution, which continue
    straight. A fitted surface ends at its border, without a region beyond it.

    Attributes:
        shape: A shape by its tag, such as ``!Cylinder``; without a part of a turn, ``angles_deg``.
        admissible: ``inside`` or ``outside`` of a closed surface; ``above``, on the side of the
            normal, or ``below`` of a plane, a fitted surface and open profiles; empty for
            ``outside``, or ``above``.
        motion: ``!Shift`` or ``!Turn``; null for a region at rest.
        stiffness: Stiffness of a soft region [N/m]; null for a hard one.
    """

    shape: RegionShape = dc.field(default_factory=Plane)
    admissible: str = ""
    motion: RegionMotion | None = None
    stiffness: Annotated[float, Range(*_STIFFNESS, "N/m, or null")] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        self.shape.check_side(self.admissible)

    @property
    def inside(self) -> bool:
        """Whether the inside, or the side below, is admissible."""
        return self.admissible in ("inside", "below")


@dc.dataclass
class GuideParameters(Parameters):
    """A path that attracts the tool: like a spring next to it, without force beyond its reach.

    See :class:`~pfsc_drake.control.fixtures.guides.Guide`.

    Attributes:
        shape: A shape of a path by its tag, such as ``!Line``.
        stiffness: Stiffness next to the path [N/m].
        reach: Distance beyond which there is no force [m].
    """

    shape: GuideShape = dc.field(default_factory=Line)
    stiffness: Annotated[float, Range(*STIFFNESS, "N/m")] = 2000.0
    reach: Annotated[float, Range(*REACH, "m")] = 0.06


_START = ("refuse", "move_out")


@dc.dataclass
class FixtureParameters(FixtureOptions):
    """Regions and guides of a tool that is guided through space, ``controller.manifold: space``.

    Mass and damping of the free motion are those of ``compliance.tangential``. Further attributes
    are those of :class:`FixtureOptions`.

    Attributes:
        regions: Regions that the tool may not enter.
        guides: Paths that attract it.
        orientation: Constant orientation of the tool.
        start_inside: Treatment of a start inside of a region: ``refuse``, or ``move_out`` slowly.
        servo_lag: Nominal lag ``tau`` of the velocity servos [s]; negative for the inverse of
            ``servo.bandwidth``.
        bound: Largest depth of the tool in a hard region [m]; a run with a larger one reports that
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
        """Names of the regions: kind of shape and number, from 1 on."""
        kinds = (type(region.shape).__name__.lower() for region in self.regions)
        return [f"{kind}_{number}" for number, kind in enumerate(kinds, start=1)]

    @property
    def guide_names(self) -> list[str]:
        """Names of the guides: kind of shape and number, from 1 on."""
        kinds = (type(guide.shape).__name__.lower() for guide in self.guides)
        return [f"{kind}_{number}" for number, kind in enumerate(kinds, start=1)]

    def lag_behind(self, bandwidth: float) -> float:
        """Return the nominal lag ``tau`` of the servos [s].

        Args:
            bandwidth: Bandwidth of the servos in the scenario [rad/s].
        """
        return self.servo_lag if self.servo_lag >= 0.0 else 1.0 / bandwidth

    def __post_init__(self) -> None:
        super().__post_init__()
        kind = self.orientation.kind
        require(kind != "normal", "orientation.kind", kind, "none, given")
