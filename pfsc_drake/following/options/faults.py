"""What a robot takes for a fault, and how it ends safely."""

import dataclasses as dc

import numpy as np

from pfsc_drake.checks import require, require_not_negative, require_positive
from pfsc_drake.yaml.typed import ONE_OR_MANY


@dc.dataclass
class BrakeParameters:
    """Holding brakes on the motors, which close after a fault.

    Attributes:
        torque: Holding torque [Nm, joint side; or N], one for all or of every joint; empty for
            the drive's limit.
        delay: From the fault until they hold [s].
    """

    torque: list[float] = dc.field(default_factory=list, metadata=ONE_OR_MANY)
    delay: float = 0.1

    def __post_init__(self) -> None:
        valid = all(0.0 <= value < np.inf for value in self.torque)
        require(valid, "torque", self.torque, "finite numbers, none negative")
        require_not_negative("delay", self.delay)


@dc.dataclass
class FaultParameters:
    """What is a fault beside what every law takes for one, and what happens then.

    Attributes:
        plausibility: By how much positions and integrated velocities of a joint may differ until
            they are not believed [rad or m], see
            :class:`~pfsc_drake.control.law.supervision.Supervision`; 0 to believe everything.
        joint_limits: Whether a joint at its limit is a fault.
        overspeed: Share of its largest speed by which a joint may be faster until it is a fault;
            ``.inf`` if no speed is.
        saturation_time: How long a drive may be at its limit [s], half of the time that it is not
            being taken off; 0 for ever, null for 0.2 s where the law commands torques, and for
            ever where it commands velocities.
        chatter_turns: How many times a drive may turn from one limit to the other, fewer being
            forgotten with 0.2 s; 0 for any number.
        hold_bandwidth: Of the position hold after a fault [rad/s].
        effort_share: Part of the drives' limits that braking is planned with, up to 1.
        brakes: Holding brakes; none without the block or with ``brakes: null``.
    """

    plausibility: float = 2e-3
    joint_limits: bool = True
    overspeed: float = 0.1
    saturation_time: float | None = None
    chatter_turns: float = 6.0
    hold_bandwidth: float = 60.0
    effort_share: float = 0.7
    brakes: BrakeParameters | None = None

    def __post_init__(self) -> None:
        require_not_negative("plausibility", self.plausibility)
        require(self.overspeed >= 0.0, "overspeed", self.overspeed, "zero or a positive number")
        if self.saturation_time is not None:
            require_not_negative("saturation_time", self.saturation_time)
        require_not_negative("chatter_turns", self.chatter_turns)
        require_positive("hold_bandwidth", self.hold_bandwidth)
        good = 0.0 < self.effort_share <= 1.0
        require(good, "effort_share", self.effort_share, "above 0, at most 1")
