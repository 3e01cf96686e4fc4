"""Noise of torques that is not white, as the spread over the periods of a motion shows it."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from identification.estimation.information import Information, MeasuredMotion

# neighbours on either side that a spectrum is averaged over
_SMOOTH = 10
# harmonics at which bands begin in all of which white noise is equally strong
_BANDS = (1, 11, 41, 161, 641)
# probability to call white noise coloured, for a band of a joint
_ERROR = 1e-5


@dataclass(frozen=True, eq=False)
class NoiseSpectrum:
    """Noise of the torques of N joints in K instants of a period.

    Attributes:
        power: Variances per sample [(Nm)^2 or N^2] at the frequencies of ``rfft``, shape
            (K // 2 + 1, N): the same at all frequencies for white noise.
        coloured: Whether the noise of a joint is coloured, shape (N,).
    """

    power: np.ndarray
    coloured: np.ndarray


def mean_torque_spectrum(motion: MeasuredMotion) -> NoiseSpectrum | None:
    """Return the spectrum of the noise in the mean torques; None if there are no periods.

    What differs from period to period is noise; what all periods share is not in it, so that a
    wrong model does not spoil it. The power is that at the harmonics of the period, averaged over
    some neighbours; over all of them in joints whose noise is equally strong in all bands of
    frequencies, but for what chance explains.

    Args:
        motion: Has torques of P periods as ``tau_periods``, shape (P, K, N), or not.

    """
    periods = getattr(motion, "tau_periods", None)
    if periods is None or len(periods) < 2:
        return None
    count, samples, _ = np.shape(periods)
    noise = np.fft.rfft(periods - np.mean(periods, axis=0), axis=1)
    power = np.sum(np.abs(noise) ** 2, axis=0) / (samples * count * (count - 1))
    flat = np.sum((periods - np.mean(periods, axis=0)) ** 2, axis=(0, 1))
    flat /= samples * count * (count - 1)
    white = np.ones(flat.shape, dtype=bool)
    for begin, end in zip(_BANDS, [*_BANDS[1:], len(power)], strict=True):
        band = power[begin:end]
        freedom = 2 * (count - 1) * len(band)
        if freedom:
            value = freedom * band.mean(axis=0) / np.maximum(flat, np.finfo(float).tiny)
            chance = np.minimum(chi2.cdf(value, freedom), chi2.sf(value, freedom))
            white &= 2.0 * chance > _ERROR
    # even about zero frequency
    padded = np.pad(power, ((_SMOOTH, _SMOOTH), (0, 0)), mode="reflect")
    sums = np.cumsum(np.pad(padded, ((1, 0), (0, 0))), axis=0)
    width = 2 * _SMOOTH + 1
    return NoiseSpectrum(np.where(white, flat, (sums[width:] - sums[:-width]) / width), ~white)


def coloured_covariance(
    inverse: np.ndarray, system: Information, spectrum: NoiseSpectrum
) -> np.ndarray:
    """Return the covariance of the weighted least-squares estimate under coloured noise.

    ``(X' W X)^-1 X' W E W X (X' W X)^-1`` with the covariance E of the torques, which in a motion
    of periods is diagonal in the frequencies.

    Args:
        inverse: ``(X' W X)^-1``, shape (n_b, n_b).
        system: The linear system.
        spectrum: Of the noise.
    """
    samples = len(system.matrix)
    both = np.full(len(spectrum.power), 2.0)
    both[0] = 1.0
    if samples % 2 == 0:
        both[-1] = 1.0
    middle = np.zeros_like(inverse)
    for j, (variance, power) in enumerate(zip(system.variance, spectrum.power.T, strict=True)):
        column = system.matrix[:, j] * (system.used[:, j] / variance)[:, None]
        parts = np.fft.rfft(column, axis=0) * np.sqrt(both * power / samples)[:, None]
        middle += (parts.conj().T @ parts).real
    covariance = inverse @ middle @ inverse
    return 0.5 * (covariance + covariance.T)
