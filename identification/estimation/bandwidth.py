"""How much of the measured positions is motion, and how much is noise.

Sec. C.2 keeps 20 harmonics of the period. That is right for a robot that follows its excitation.
One whose servo does not know its friction sticks a little at each reversal and moves with edges, of
which such a filter leaves nothing: accelerations are missing and parameters are biased, far more
than their covariance tells. With too large a bandwidth the noise of the positions, whose second
derivative grows with the frequency squared, biases them as well. What is left of the torques at low
frequencies tells both.
"""

from dataclasses import dataclass

import numpy as np

from identification.estimation.least_squares import estimate
from identification.estimation.residuals import Excess, excess
from identification.measurement.periods import HARMONICS_KEPT, AveragedMotion, average
from identification.measurement.record import Record
from identification.model.base import BaseParameters
from identification.model.regressor import Regressor
from pfsc_drake.geometry.progress import Progress

# in units of 20 harmonics
_MULTIPLES = (1.0, 2.0, 5.0, 10.0, 20.0, 40.0)
# standard deviations by which what is left may be above the least
_CHANCE = 3.0


@dataclass(frozen=True, eq=False)
class BandwidthChoice:
    """The bandwidth with which positions are filtered.

    Attributes:
        motion: The record averaged with it.
        candidates: Bandwidths that were tried [Hz], rising.
        excesses: What each leaves of the torques.
    """

    motion: AveragedMotion
    candidates: tuple[float, ...]
    excesses: tuple[Excess, ...]

    @property
    def bandwidth_hz(self) -> float:
        """``f_g`` [Hz]."""
        return self.motion.bandwidth_hz

    @property
    def excess(self) -> Excess:
        """What the chosen one leaves."""
        return self.excesses[self.candidates.index(self.bandwidth_hz)]


def choose_bandwidth(
    regressor: Regressor,
    base: BaseParameters,
    record: Record,
    period: float | None = None,
    skip: int = 1,
    progress: Progress | None = None,
) -> BandwidthChoice:
    """Return the least bandwidth with which the model explains torques as well as with any.

    Args:
        regressor: Of the robot.
        base: Its base parameters.
        record: Of a periodic motion.
        period: ``T_f`` [s]; by default the record's.
        skip: Periods at the start that are left out.
        progress: Told the fraction done and what is done.

    Raises:
        InputError: As of :func:`~identification.measurement.periods.average` and
            :func:`~identification.estimation.least_squares.estimate`.
    """
    first = average(record, period, skip)
    half = 0.5 * len(first.t) / first.period
    lowest = HARMONICS_KEPT / first.period
    candidates = [lowest * m for m in _MULTIPLES if lowest * m < half]
    motions, excesses = [], []
    for i, candidate in enumerate(candidates):
        if progress is not None:
            progress(i / len(candidates), "choosing the bandwidth")
        motion = average(record, period, skip, candidate)
        result = estimate(regressor, base, motion, white=True)
        motions.append(motion)
        excesses.append(
            excess(result.residuals, result.system.used, motion, parameters=result.base.rank)
        )
    left = np.array([found.ratio.mean() for found in excesses])
    chance = np.sqrt(2.0 / (excesses[0].freedom * record.dimension))
    chosen = int(np.argmax(left <= left.min() * (1.0 + _CHANCE * chance)))
    return BandwidthChoice(motions[chosen], tuple(candidates), tuple(excesses))
