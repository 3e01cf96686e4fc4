"""Forces on a scenario's robot, beside scripted pulses and a hand."""

import dataclasses as dc

import numpy as np

from diagrams.scenario.checks import (
    require,
    require_positive,
)


@dc.dataclass
class HoldBackParameters:
    """A wrench that holds the robot back along its path and has no other effect (Sec. 3.8.4).

    Attributes:
        begin: When it leaves zero [s].
        end: When it is zero again [s].
        force: Along the tangent [N], negative against growing ``eta``; 0 for none.
        ramp: Time from zero to full and back [s].
    """

    begin: float = 0.0
    end: float = 1.0
    force: float = 0.0
    ramp: float = 0.05

    def __post_init__(self) -> None:
        require(np.isfinite(self.force), "force", self.force, "a finite number")
        require_positive("ramp", self.ramp)
        long_enough = 2.0 * self.ramp <= (self.end - self.begin) * (1.0 + 1e-9)
        require(long_enough, "end", self.end, "begin + 2 ramp or later")
