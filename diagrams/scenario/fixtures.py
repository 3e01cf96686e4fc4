"""Virtual fixtures of a scenario: regions that a tool led by hand may not enter."""

import dataclasses as dc

from diagrams.scenario.checks import require, require_between, require_not_negative
from diagrams.scenario.region import RegionParameters
from diagrams.scenario.surface import SurfaceOrientationParameters
from pfsc_drake.control.fixtures.parameters import GuidanceParameters, RobotLimitParameters

_START = ("refuse", "move_out")


@dc.dataclass
class FixtureParameters:
    """What limits a tool that is led through space, ``controller.manifold: space``.

    Mass and damping of the free motion are those of ``compliance.tangential``.

    Attributes:
        regions: Where the tool may not go.
        guidance: How it is kept out.
        limits: How far it follows a hand to where the robot itself cannot go on.
        orientation: That the tool keeps.
        start_inside: Of a region that the tool starts in: ``refuse``, or ``move_out`` slowly.
        servo_lag: ``tau`` [s] of the velocity servos as it is believed; negative for the inverse
            of ``servo.bandwidth``.
        smoothing: Time constant [s] of each of the r - 1 lags that make the reference smooth
            enough for laws that give torques.
        bound: How deep the tool may be in a hard region [m]; a run in which it was deeper says so
            and ends with status 3.
        looks: Most distances that are computed at a tick beside those of regions that are near;
            0 for as many as are due.
    """

    regions: list[RegionParameters] = dc.field(default_factory=list)
    guidance: GuidanceParameters = dc.field(default_factory=GuidanceParameters)
    limits: RobotLimitParameters = dc.field(default_factory=RobotLimitParameters)
    orientation: SurfaceOrientationParameters = dc.field(
        default_factory=SurfaceOrientationParameters
    )
    start_inside: str = "refuse"
    servo_lag: float = -1.0
    smoothing: float = 0.003
    bound: float = 0.5e-3
    looks: int = 0

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
        known = self.start_inside in _START
        require(known, "start_inside", self.start_inside, ", ".join(_START))
        kind = self.orientation.kind
        require(kind != "normal", "orientation.kind", kind, "none, given")
        require(self.servo_lag < 0.1, "servo_lag", self.servo_lag, "below 0.1 s")
        require_between("smoothing", self.smoothing, 1e-3, 0.1, "s")
        require_between("bound", self.bound, 1e-6, 0.1, "m")
        require_not_negative("looks", self.looks)
