"""Synchronization of a record's signals."""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from identification.measurement.periods import AveragedMotion
from identification.measurement.record import Record
from pfsc_drake.errors import InputError

LONGEST_LAG = 0.1  # s, range of the search for lags
TOLERATED = 2.0  # sampling times
_SURE = 3.0  # standard deviations
_RANK = 1e-10
# of a joint's largest velocity, below which its torques do not count, and not fully up to twice
_SLOW = 0.1
_NEAR = 6  # samples on either side of the best lag, for its standard deviation
_ENOUGH = 20_000  # samples for the lag of a measured velocity
_SCALE = 0.1  # tolerated difference of a measured velocity from the derivative of the position


@dataclass(frozen=True)
class Lag:
    """Lag of one signal behind another.

    Attributes:
        time: Lag [s], positive if it is late.
        standard_deviation: Standard deviation of the lag [s].
    """

    time: float
    standard_deviation: float

    def is_beyond(self, tolerance: float) -> bool:
        """Return whether it certainly exceeds a tolerance [s]."""
        return abs(self.time) > tolerance + _SURE * self.standard_deviation


def torque_lag(motion: AveragedMotion, regressor: np.ndarray) -> Lag:
    """Return the lag of the torques with which a model explains them best.

    For each lag the parameters of the model are estimated again, so that none need to be known:
    with an orthonormal basis of the weighted regressor's columns the residual follows from the
    circular correlation of the basis with the torques. Samples with a slow joint do not count: a
    joint that sticks before it reverses has late torques without any lag.

    Args:
        motion: One period.
        regressor: ``Y(q, v, a)`` along the motion, of full or base parameters, with friction,
            shape (K, N, n).

    Raises:
        InputError: If the regressor belongs to another motion.
    """
    count, joints = motion.tau.shape
    if regressor.shape[:2] != (count, joints):
        raise InputError(
            f"regressor of shape {regressor.shape}; must be ({count}, {joints}, n) as the motion"
        )
    weight = _weight(motion)
    basis = _basis((regressor * weight[..., None]).reshape(count * joints, -1))
    weighted = basis.reshape(count, joints, -1) * weight[..., None]
    torques = np.fft.fft(motion.tau, axis=0)
    cross = np.zeros((basis.shape[1], count), dtype=complex)
    energy = np.zeros(count, dtype=complex)
    for j in range(joints):
        cross += (torques[:, j, None] * np.fft.fft(weighted[:, j], axis=0).conj()).T
        energy += np.fft.fft(motion.tau[:, j] ** 2) * np.fft.fft(weight[:, j] ** 2).conj()
    left = np.fft.ifft(energy).real - np.sum(np.fft.ifft(cross, axis=1).real ** 2, axis=0)
    step = motion.period / count
    reach = min(max(2, round(LONGEST_LAG / step)), count // 2 - 1)
    lags = np.arange(-reach, reach + 1)
    best = int(lags[np.argmin(left[lags])])
    near = np.arange(best - _NEAR, best + _NEAR + 1)
    bend, slope, least = np.polyfit(near - best, left[near % count], 2)
    if bend <= 0.0:
        return Lag(best * step, np.inf)
    least -= 0.25 * slope**2 / bend
    variance = max(float(least), 0.0) / max(np.count_nonzero(weight) - basis.shape[1], 1)
    return Lag(float(best - 0.5 * slope / bend) * step, float(np.sqrt(variance / bend)) * step)


def _weight(motion: AveragedMotion) -> np.ndarray:
    """Return the weight of each torque, shape (K, N)."""
    speed = np.abs(motion.v)
    share = speed / np.maximum(speed.max(axis=0), np.finfo(float).tiny)
    deviation = np.sqrt(motion.mean_torque_variance)
    if not (np.isfinite(deviation).all() and deviation.all()):
        deviation = np.ones(motion.tau.shape[1])
    return np.asarray(np.clip(share / _SLOW - 1.0, 0.0, 1.0) / deviation)


def check_torque_lag(motion: AveragedMotion, regressor: np.ndarray) -> Lag:
    """Refuse torques that are late or early compared to the motion.

    Args:
        motion: One period.
        regressor: ``Y(q, v, a)`` along the motion, with friction, as for :func:`torque_lag`.

    Returns:
        The tolerated lag.

    Raises:
        InputError: If they are off by more than two sampling times, with certainty.
    """
    lag = torque_lag(motion, regressor)
    allowed = TOLERATED * motion.period / len(motion.t)
    if lag.is_beyond(allowed):
        raise InputError(
            f"tau {_late(lag.time)} the motion by {abs(lag.time) * 1e3:.3g} ms (standard "
            f"deviation {lag.standard_deviation * 1e3:.2g} ms); allowed: {allowed * 1e3:.3g} ms, "
            "shift it"
        )
    return lag


def check_velocities(record: Record) -> None:
    """Refuse velocities that differ from the positions' derivative: late, scaled or reversed.

    Args:
        record: Record; without velocities nothing is checked.

    Raises:
        InputError: With joint and lag above two sampling times, or factor.
    """
    if record.v is None:
        return
    allowed = TOLERATED * record.sampling_time
    rates = np.gradient(record.q, record.sampling_time, axis=0)
    for j, name in enumerate(record.joint_names):
        if not (rates[:, j].any() and record.v[:, j].any()):
            continue
        rate, v = rates[:_ENOUGH, j], record.v[:_ENOUGH, j]
        lag, factor = _delay(rate, v, record.sampling_time)
        if not abs(factor - 1.0) <= _SCALE:
            raise InputError(
                f"{record.source}: v of {name} is {factor:.4g} times the derivative of q; must be "
                "1 (unit, sign or order of the joints)"
            )
        if abs(lag) > allowed:
            raise InputError(
                f"{record.source}: v of {name} {_late(lag)} the derivative of q by "
                f"{abs(lag) * 1e3:.3g} ms; allowed: {allowed * 1e3:.3g} ms (leave v out, or shift "
                "the late signal)"
            )


def _late(lag: float) -> str:
    return "lags" if lag > 0.0 else "leads"


def _basis(matrix: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of a matrix' columns."""
    Q, R, _ = scipy.linalg.qr(matrix, mode="economic", pivoting=True)
    sizes = np.abs(np.diag(R))
    return Q[:, : int(np.sum(sizes > _RANK * sizes[0]))]


def _delay(first: np.ndarray, second: np.ndarray, step: float) -> tuple[float, float]:
    """Return the lag of the second signal [s], and its factor at that lag."""
    reach = min(max(2, round(LONGEST_LAG / step)), first.size // 4)
    middle = slice(reach, first.size - reach)
    window = np.lib.stride_tricks.sliding_window_view(first, first.size - 2 * reach)
    factors = window @ second[middle] / np.maximum(np.sum(window**2, axis=1), 1e-300)
    errors = np.sum(second[middle] ** 2) - factors**2 * np.sum(window**2, axis=1)
    k = int(np.clip(np.argmin(errors), 1, 2 * reach - 1))
    before, at, after = errors[k - 1 : k + 2]
    bend = before - 2.0 * at + after
    shift = 0.5 * (before - after) / bend if bend > 0.0 else 0.0
    return (reach - k - shift) * step, float(factors[k])
