"""How forces on the tool are known without a sensor."""

import dataclasses as dc

from pfsc_drake.checks import require_not_negative, require_positive


@dc.dataclass
class ObservedForceParameters:
    """Forces on the tool from the torques in the joints, without a sensor.

    Attributes:
        rate: Of the observer [1/s].
        damping: Of the inverse of the Jacobian in singular postures.
        force_dead_band: [N]; friction and model errors are taken for forces below it.
        torque_dead_band: [Nm].
    """

    rate: float = 100.0
    damping: float = 0.02
    force_dead_band: float = 0.0
    torque_dead_band: float = 0.0

    def __post_init__(self) -> None:
        require_positive("rate", self.rate)
        for key in ("damping", "force_dead_band", "torque_dead_band"):
            require_not_negative(key, getattr(self, key))
