"""Planned demand of a motion on the drives."""

from dataclasses import dataclass

import numpy as np

from pfsc_drake.control.planning.limiting import Limiting
from pfsc_drake.geometry import PiecewisePolynomialCurve

# largest share of the drive limits that a faster motion may use
_USED = 0.95


@dataclass(frozen=True)
class DrivePlan:
    """Demand of a reference on the drives, by the nominal model.

    Attributes:
        times: Times of the samples, in the time of the followed reference [s], (samples,).
        demand: Torques [Nm or N] and joint speeds [rad/s or m/s] that it needs, (samples, 2N).
        requested_demand: The same of the requested reference, at the same points of the path.
        limits: Nominal limits of the drives, (2N,).
        speed_scaling: Speed as a share of the requested one, (samples,).
        motion: Followed reference: the requested one where that fits.
        messages: Messages, one sentence each.
        limiting: Active limits, if it is the fastest motion.
    """

    times: np.ndarray
    demand: np.ndarray
    requested_demand: np.ndarray
    limits: np.ndarray
    speed_scaling: np.ndarray
    motion: PiecewisePolynomialCurve
    messages: list[str]
    limiting: Limiting | None = None

    def largest_scaling(self, relative_degree: int) -> float:
        """Return the largest speed scaling of the motion, at least 1.

        Speeds grow with the scaling, torques at most with its square, torques of elastic joints
        with its power r.

        Args:
            relative_degree: r of the law.
        """
        if not len(self.demand):
            return 1.0
        most = np.abs(self.demand).max(axis=0)
        factor = np.where(most > 0.0, _USED * self.limits / np.maximum(most, 1e-12), np.inf)
        torques, speeds = np.split(factor, 2)
        power = 1.0 / max(relative_degree, 2)
        return float(max(1.0, min((torques**power).min(), speeds.min())))

    @property
    def speed(self) -> np.ndarray:
        """Speed of the reference, its largest tangential coordinate's [m/s], shape (samples,)."""
        return np.asarray(np.abs(self.motion.derivatives(self.times, 1)[:, 1]).max(axis=1))

    @property
    def waiting_time(self) -> float:
        """Extension of the motion beyond the requested duration [s]."""
        scaling = self.speed_scaling
        return float(np.sum(np.diff(self.times) * (1.0 - (scaling[1:] + scaling[:-1]) / 2.0)))

    @property
    def is_slowed(self) -> bool:
        """Whether the reference is slower than the requested one."""
        return bool(np.any(self.speed_scaling < 1.0))
