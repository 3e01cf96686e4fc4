"""Teleoperation: coupling, channel, and the leader device in the operator's hand."""

import dataclasses as dc

from pfsc_drake.checks import require
from pfsc_drake.control.teleoperation.coupling_parameters import CouplingParameters
from pfsc_drake.physics.channel import ChannelParameters
from pfsc_drake.physics.leader_clutch import ClutchParameters
from pfsc_drake.physics.leader_device import LeaderParameters
from pfsc_drake.yaml.rules import Positive

# the channel back has random delays and losses of its own
_OTHER_SEED = 1000
_BUSES = ("udpm", "memq")


@dc.dataclass
class TeleoperationParameters(CouplingParameters):
    """Teleoperation: a hand at a leader device commands the tool and feels its forces.

    The scenario's ``hand`` then holds the leader device, and its targets are those of the tool.

    Attributes:
        channel: Channel between both sides, in each direction.
        leader: The device in the operator's hand.
        clutch: Intervals in which the operator releases the device, to take it elsewhere.
        lcm: LCM bus of a leader in another process (``lead``), such as
            ``udpm://239.255.76.67:7667?ttl=0``; the run then waits for the clock, and channel and
            leader are those of the other process. Empty where both are simulated here.
        silence: Time without messages of that leader after which a driven robot is stopped [s].
        follower_force: Largest force that moves the tool [N].
        follower_speed: Largest speed of the tool, for the follower's reserve of energy [m/s];
            within regions it is at least the speed of ``fixtures.guidance``.
        follower_moment: Largest moment that turns the tool [Nm].
        follower_turning: Largest angular velocity of the tool [rad/s].
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
