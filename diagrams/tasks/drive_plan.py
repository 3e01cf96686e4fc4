"""What a reference asks of the drives."""

from dataclasses import dataclass

import numpy as np

from pfsc_drake.geometry import PiecewisePolynomialCurve


@dataclass(frozen=True)
class DrivePlan:
    """What a reference asks of the drives, as it is believed.

    Attributes:
        times: Of the samples, in the time of the reference that is followed [s], (samples,).
        demand: Torques [Nm or N] and joint speeds [rad/s or m/s] that it asks for, (samples, 2N).
        asked: The same of the reference that was asked for, at the same places.
        limits: What is believed of the drives, (2N,).
        pace: Speed in units of the one that was asked for, (samples,).
        motion: The reference that is followed: the one asked for where that fits.
        said: What there is to say, one sentence each.
    """

    times: np.ndarray
    demand: np.ndarray
    asked: np.ndarray
    limits: np.ndarray
    pace: np.ndarray
    motion: PiecewisePolynomialCurve
    said: list[str]

    @property
    def waiting_time(self) -> float:
        """How much longer the motion takes than was asked for [s]."""
        return float(np.sum(np.diff(self.times) * (1.0 - (self.pace[1:] + self.pace[:-1]) / 2.0)))

    @property
    def is_slowed(self) -> bool:
        """Whether the reference is not the one that was asked for."""
        return bool(np.any(self.pace < 1.0))
