"""Residuals of measured torques: noise, filtered motion, or missing terms of a model.

Sec. C.2 uses 20 harmonics of the period. That is right for a robot that follows its excitation. A
robot whose servo does not compensate friction sticks a little at each reversal and moves with
edges,
which such a filter removes: accelerations are missing and parameters are biased, far more than
their covariance indicates. If the bandwidth is too large, the noise of the positions, whose second
derivative grows with the frequency squared, biases them as well. The residuals at low frequencies
show both.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2
from scipy.stats import f as fisher

from identification.estimation.least_squares import estimate, mean_torque_spectrum
from identification.measurement.periods import HARMONICS_KEPT, AveragedMotion, average
from identification.measurement.record import Record
from identification.model.base import BaseParameters
from identification.model.regressor import Regressor
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.progress import Progress

# delays of the autocorrelation, in samples
LAGS = 20
# of the period, highest harmonic for the residuals
_HARMONICS = 100


@dataclass(frozen=True, eq=False)
class Whiteness:
    """Ljung-Box test whether the residuals of N joints are white.

    Attributes:
        joint_names: N names.
        autocorrelation: At delays of 1, 2, .. samples, shape (L, N).
        bound: 95 % of the autocorrelations of white residuals are within +- this, shape (N,).
        statistic: ``sum_h (n + 2) n / (n - h) r_h^2``, shape (N,); chi-squared with L degrees of
            freedom for white residuals.
        p_value: Probability of a larger statistic, shape (N,).
    """

    joint_names: tuple[str, ...]
    autocorrelation: np.ndarray
    bound: np.ndarray
    statistic: np.ndarray
    p_value: np.ndarray


def whiteness(
    residuals: np.ndarray, used: np.ndarray, joint_names: Sequence[str], lags: int = LAGS
) -> Whiteness:
    """Test residuals for whiteness.

    Args:
        residuals: Shape (K, N), samples at an even rate.
        used: Which residuals count, shape (K, N); pairs with an unused one are left out.
        joint_names: N names.
        lags: Largest delay [samples].

    Raises:
        InputError: If a joint has fewer than 5 times as many residuals as delays.
    """
    counts = used.sum(axis=0)
    if lags < 1 or np.any(counts < 5 * lags):
        j = int(np.argmin(counts))
        raise InputError(
            f"whiteness: {counts[j]} residuals of {joint_names[j]}, delays to {lags}; at least one "
            "delay and 5 times as many residuals are required"
        )
    centered = np.where(used, residuals - np.mean(residuals, axis=0, where=used), 0.0)
    power = np.sum(centered**2, axis=0) / counts
    autocorrelation, statistic = np.empty((lags, len(joint_names))), np.zeros(len(joint_names))
    for h in range(1, lags + 1):
        pairs = np.sum(used[h:] & used[:-h], axis=0)
        autocorrelation[h - 1] = np.sum(centered[h:] * centered[:-h], axis=0) / pairs / power
        # (n + 2) n / (n - h) r^2 with r a sum over all n, without gaps
        statistic += pairs * (counts + 2) / counts * autocorrelation[h - 1] ** 2
    return Whiteness(
        tuple(joint_names),
        autocorrelation,
        1.96 / np.sqrt(counts),
        statistic,
        chi2.sf(statistic, lags),
    )


@dataclass(frozen=True, eq=False)
class Excess:
    """Power of the residuals of N joints at low frequencies, relative to the noise there.

    Noise is the difference between periods, of any colour. An incomplete model leaves more: a part
    that is the same in all periods. Above the frequencies of the motion it may come from the
    robot's drives, whose torques oscillate without moving it.

    Attributes:
        freedom: Degrees of freedom of the residuals of a joint.
        ratio: Ratio of the powers, shape (N,); 1 for pure noise.
        p_value: Probability of a larger ratio for pure noise, shape (N,).
    """

    freedom: float
    ratio: np.ndarray
    p_value: np.ndarray


def excess(
    residuals: np.ndarray,
    used: np.ndarray,
    motion: AveragedMotion,
    highest_hz: float | None = None,
    parameters: int = 0,
) -> Excess:
    """Compare residuals with noise at low frequencies.

    Args:
        residuals: Residuals of the mean torques, shape (K, N).
        used: Which residuals count, shape (K, N).
        motion: Motion of the residuals.
        highest_hz: Highest frequency [Hz]; by default 100 harmonics of the period.
        parameters: Number of parameters estimated from the same torques, which reduces the degrees
            of freedom; 0 for another motion.

    Raises:
        InputError: If the frequency is not between the period's and half the sampling rate, or
            there are more parameters than frequencies.
    """
    samples, joints = residuals.shape
    half = 0.5 * samples / motion.period
    highest = min(_HARMONICS / motion.period, half) if highest_hz is None else highest_hz
    count = int(np.floor(highest * motion.period * (1.0 + 1e-9)))
    if not 1 <= count <= samples // 2:
        raise InputError(
            f"excess: highest frequency {highest:g} Hz; must be from {1.0 / motion.period:g} Hz to "
            f"{half:g} Hz"
        )
    freedom = 2.0 * count - parameters / joints
    if freedom < 1.0:
        raise InputError(
            f"excess: {parameters} parameters, {count} frequencies of {joints} joints to "
            f"{highest:g} Hz; must be fewer"
        )
    spectrum = mean_torque_spectrum(motion)
    assert spectrum is not None  # averages have two periods or more
    band = slice(1, count + 1)
    power = np.abs(np.fft.rfft(np.where(used, residuals, 0.0), axis=0)) ** 2
    power *= 1.0 / used.sum(axis=0)
    ratio = np.sum(2.0 * power[band] / spectrum[0][band], axis=0) / freedom
    return Excess(freedom, ratio, fisher.sf(ratio, freedom, 2.0 * count * (motion.periods - 1)))


# in units of 20 harmonics
_MULTIPLES = (1.0, 2.0, 5.0, 10.0, 20.0, 40.0)
# standard deviations, tolerance of the residuals above the least ones
_CHANCE = 3.0


@dataclass(frozen=True, eq=False)
class BandwidthChoice:
    """Bandwidth for filtering the positions.

    Attributes:
        motion: The record averaged with it.
        candidates: Tested bandwidths [Hz], rising.
        excesses: Excess of the residuals for each of them.
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
        """Excess of the residuals for the chosen bandwidth."""
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
        regressor: Regressor of the robot.
        base: Its base parameters.
        record: Record of a periodic motion.
        period: ``T_f`` [s]; by default the record's.
        skip: Periods at the start to leave out.
        progress: Receives the completed fraction and the current step.

    Raises:
        InputError: As in :func:`~identification.measurement.periods.average` and
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
