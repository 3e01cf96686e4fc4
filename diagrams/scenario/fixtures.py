"""Virtual fixtures of a scenario: regions that a tool led by hand may not enter."""

import dataclasses as dc

from diagrams.scenario.checks import require, require_between
from diagrams.scenario.region import RegionParameters
from diagrams.scenario.surface import SurfaceOrientationParameters
from pfsc_drake.following.options.follower import FixtureOptions

_START = ("refuse", "move_out")


@dc.dataclass
class FixtureParameters(FixtureOptions):
    """What limits a tool that is led through space, ``controller.manifold: space``.

    Mass and damping of the free motion are those of ``compliance.tangential``. Further attributes
    are those of :class:`FixtureOptions`.

    Attributes:
        regions: Where the tool may not go.
        orientation: That the tool keeps.
        start_inside: Of a region that the tool starts in: ``refuse``, or ``move_out`` slowly.
        servo_lag: ``tau`` [s] of the velocity servos as it is believed; negative for the inverse
            of ``servo.bandwidth``.
        bound: How deep the tool may be in a hard region [m]; a run in which it was deeper says so
            and ends with status 3.
    """

    regions: list[RegionParameters] = dc.field(default_factory=list)
    orientation: SurfaceOrientationParameters = dc.field(
        default_factory=SurfaceOrientationParameters
    )
    start_inside: str = "refuse"
    servo_lag: float = -1.0
    bound: float = 0.5e-3

    @property
    def names(self) -> list[str]:
        """What the regions are called: kind of shape and number, from 1 on."""
        kinds = (type(region.shape).__name__.lower() for region in self.regions)
        return [f"{kind}_{number}" for number, kind in enumerate(kinds, start=1)]

    def lag_behind(self, bandwidth: float) -> float:
        """Return ``tau`` [s] of the servos as it is believed.

        Args:
            bandwidth: Of the servos as the scenario has it [rad/s].
        """
        return self.servo_lag if self.servo_lag >= 0.0 else 1.0 / bandwidth

    def __post_init__(self) -> None:
        super().__post_init__()
        known = self.start_inside in _START
        require(known, "start_inside", self.start_inside, ", ".join(_START))
        kind = self.orientation.kind
        require(kind != "normal", "orientation.kind", kind, "none, given")
        require(self.servo_lag < 0.1, "servo_lag", self.servo_lag, "below 0.1 s")
        require_between("bound", self.bound, 1e-6, 0.1, "m")
