"""A robot that is led from afar: coupling, channel, the device in the operator's hand."""

import dataclasses as dc

from pfsc_drake.checks import require
from pfsc_drake.control.teleoperation.coupling_parameters import CouplingParameters
from pfsc_drake.physics.channel import ChannelParameters
from pfsc_drake.physics.leader_clutch import ClutchParameters
from pfsc_drake.physics.leader_device import LeaderParameters
from pfsc_drake.yaml.rules import Positive

# the way back draws its own delays and losses
_OTHER_SEED = 1000
_BUSES = ("udpm", "memq")


@dc.dataclass
class TeleoperationParameters(CouplingParameters):
    """A hand elsewhere that leads the tool, and feels what the tool feels.

    The scenario's ``hand`` holds the leader then, and says where the tool is to be.

    Attributes:
        channel: Between the two, each way.
        leader: The device in the operator's hand.
        clutch: When the operator lets it loose, to take hold of it elsewhere.
        lcm: LCM bus on which a leader in another process leads (``lead``), such as
            ``udpm://239.255.76.67:7667?ttl=0``; the run waits for the clock then, and channel and
            leader are those of the other process. Empty where both are simulated here.
        silence: How long that leader may be silent until a robot that is driven is stopped [s].
        follower_force: Largest force by which the tool is led [N].
        follower_speed: Largest speed that the tool is led with, which the follower's reserve of
            energy is for [m/s]; within regions it is at least that of ``fixtures.guidance``.
        follower_moment: Largest moment by which the tool is turned [Nm].
        follower_turning: Largest angular velocity that it is turned with [rad/s].
    """

    channel: ChannelParameters = dc.field(default_factory=ChannelParameters)
    leader: LeaderParameters = dc.field(default_factory=LeaderParameters)
    clutch: list[ClutchParameters] = dc.field(default_factory=list)
    lcm: str = ""
    silence: Positive = 0.5
    follower_force: Positive = 60.0
    follower_speed: Positive = 1.0
    follower_moment: Positive = 10.0
    follower_turning: Positive = 2.0

    def __post_init__(self) -> None:
        super().__post_init__()
        known = not self.lcm or self.lcm.partition("://")[0] in _BUSES
        require(known, "lcm", self.lcm, f"empty, or a bus: {', '.join(_BUSES)}://..")
        ends = [time for at in self.clutch for time in (at.begin, at.end)]
        allowed = "times that follow each other"
        require(ends == sorted(ends), "clutch", ends, allowed)

    @property
    def back(self) -> ChannelParameters:
        """Channel from the follower to the leader."""
        return dc.replace(self.channel, seed=self.channel.seed + _OTHER_SEED)
