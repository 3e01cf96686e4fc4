"""A motion's demand on the drives, as it is planned."""

from dataclasses import dataclass

import numpy as np

from pfsc_drake.control.planning.limiting import Limiting
from pfsc_drake.geometry import PiecewisePolynomialCurve

# of what drives can do, the largest share that a faster motion may ask for
_USED = 0.95


@dataclass(frozen=True)
class DrivePlan:
    """What a reference asks of the drives, as it is believed.

    Attributes:
        times: Times of the samples, in the time of the reference that is followed [s], (samples,).
        demand: Torques [Nm or N] and joint speeds [rad/s or m/s] that it asks for, (samples, 2N).
        asked: The same of the reference that was asked for, at the same places.
        limits: What is believed of the drives, (2N,).
        pace: Speed in units of the one that was asked for, (samples,).
        motion: The reference that is followed: the one asked for where that fits.
        said: What there is to say, one sentence each.
        limiting: Which limits it is at, if it is the fastest.
    """

    times: np.ndarray
    demand: np.ndarray
    asked: np.ndarray
    limits: np.ndarray
    pace: np.ndarray
    motion: PiecewisePolynomialCurve
    said: list[str]
    limiting: Limiting | None = None

    def fastest_pace(self, relative_degree: int) -> float:
        """Return how many times as fast the motion may be made, at least 1.

        Speeds grow with the pace, torques with its square at most, those of elastic joints with its
        power r.

        Args:
            relative_degree: r of the law.
        """
        if not len(self.demand):
            return 1.0
        most = np.abs(self.demand).max(axis=0)
        room = np.where(most > 0.0, _USED * self.limits / np.maximum(most, 1e-12), np.inf)
        torques, speeds = np.split(room, 2)
        power = 1.0 / max(relative_degree, 2)
        return float(max(1.0, min((torques**power).min(), speeds.min())))

    @property
    def speed(self) -> np.ndarray:
        """Speed of the reference, its largest tangential coordinate's [m/s], shape (samples,)."""
        return np.asarray(np.abs(self.motion.derivatives(self.times, 1)[:, 1]).max(axis=1))

    @property
    def waiting_time(self) -> float:
        """How much longer the motion takes than was asked for [s]."""
        return float(np.sum(np.diff(self.times) * (1.0 - (self.pace[1:] + self.pace[:-1]) / 2.0)))

    @property
    def is_slowed(self) -> bool:
        """Whether the reference is not the one that was asked for."""
        return bool(np.any(self.pace < 1.0))
