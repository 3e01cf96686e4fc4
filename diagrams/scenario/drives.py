"""What is between the law and the joints of a scenario's robot: servos."""

import dataclasses as dc

import numpy as np

from diagrams.scenario.checks import require, require_not_negative, require_positive

_SHORTEST_PERIOD = 1e-6  # s


@dc.dataclass
class LostFrames:
    """When a bus loses its frames.

    Attributes:
        begin: From when on [s].
        end: Until when [s]; not later than ``begin`` for never.
    """

    begin: float = 0.0
    end: float = 0.0

    def __post_init__(self) -> None:
        finite = bool(np.isfinite(self.begin)) and not np.isnan(self.end)
        require(finite, "begin", [self.begin, self.end], "numbers of seconds")


@dc.dataclass
class ServoParameters:
    """Velocity controllers of the joints, behind the law ``velocity_servo``.

    Attributes:
        bandwidth: ``omega`` [rad/s], see :func:`~pfsc_drake.physics.velocity_servo.servo_gains`.
        integral_rate: Rate at which loads are removed [rad/s]; 0 for no integral part,
            negative for a quarter of the bandwidth.
        period: Sampling time [s], from 1e-6 on, a whole fraction of the controller's; 0 for the
            same.
        bus_delay: Delay between law and servo [s], a multiple of the controller's
            sampling time, at most 10,000 of it; 0 for none.
        lost: When the bus loses what is sent; it needs a delay.
        watchdog: How long no reference may come over the bus until the servos stop by
            themselves [s]; 0 for ever.
    """

    bandwidth: float = 200.0
    integral_rate: float = -1.0
    period: float = 0.0
    bus_delay: float = 0.0
    lost: LostFrames = dc.field(default_factory=LostFrames)
    watchdog: float = 0.01

    def __post_init__(self) -> None:
        require_positive("bandwidth", self.bandwidth)
        require(
            bool(np.isfinite(self.integral_rate)),
            "integral_rate",
            self.integral_rate,
            "a finite number",
        )
        good = self.period == 0.0 or _SHORTEST_PERIOD <= self.period <= 0.1
        allowed = f"zero or a positive number, {_SHORTEST_PERIOD:g} to 0.1 s"
        require(good, "period", self.period, allowed)
        require_not_negative("bus_delay", self.bus_delay)
        require_not_negative("watchdog", self.watchdog)
        loses = self.lost.end > self.lost.begin
        require(not loses or self.bus_delay > 0.0, "lost", self.lost, "only with a bus_delay")
