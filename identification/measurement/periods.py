"""Averages over the periods of a motion, and its exact derivatives, Sec. 2.5.2."""

from dataclasses import dataclass

import numpy as np

from identification.measurement.record import Record, check_sampling
from pfsc_drake.errors import InputError

HARMONICS_KEPT = 20  # f_g = 20 / T_f, Sec. C.2
_WHOLE = 1e-6  # of a sampling time, tolerance of a period as a multiple of it
_FEWEST_PERIODS = 2  # after the skipped ones, so that they have a spread
_REPEATS = 0.02  # of the travel, tolerated difference of positions between periods
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class AveragedMotion:
    """One period of a motion, averaged over P periods, at K instants; N joints.

    Attributes:
        t: Times from the start of a period [s], shape (K,).
        q: Positions, filtered to the bandwidth [rad or m], shape (K, N).
        v: Their derivatives, shape (K, N).
        a: Their second derivatives, shape (K, N).
        tau: Mean torques, not filtered [Nm or N], shape (K, N).
        torque_variance: Variance of one measured torque, from the spread over the periods,
            shape (N,) [(Nm)^2 or N^2]: the diagonal of the covariance of the torques in (2.80).
        position_variance: The same for one measured position, shape (N,).
        tau_periods: Torques of the single periods, shape (P, K, N).
        period: ``T_f`` [s].
        bandwidth_hz: ``f_g`` [Hz].
        joint_names: N names.
    """

    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    tau: np.ndarray
    torque_variance: np.ndarray
    position_variance: np.ndarray
    tau_periods: np.ndarray
    period: float
    bandwidth_hz: float
    joint_names: tuple[str, ...]

    @property
    def periods(self) -> int:
        """Number P of averaged periods."""
        return len(self.tau_periods)

    @property
    def mean_torque_variance(self) -> np.ndarray:
        """Variance of ``tau``, smaller than the one of a measurement by P, shape (N,)."""
        return self.torque_variance / self.periods


def average(
    record: Record,
    period: float | None = None,
    skip: int = 1,
    bandwidth_hz: float | None = None,
) -> AveragedMotion:
    """Average a record over its periods, and differentiate its positions.

    Incomplete periods at the end are left out. The spread over the periods, whose sum of squares
    has (P - 1) K degrees of freedom, is an estimate of the variance of one measurement, whatever
    the mean is.

    Args:
        record: Signals at an even rate that divides the period.
        period: ``T_f`` [s]; by default the record's.
        skip: Periods at the start to leave out, in which the motion has not settled.
        bandwidth_hz: ``f_g``, highest frequency of the positions [Hz]; by default
            ``20 / T_f``.

    Raises:
        InputError: If the period is not known or not a multiple of the sampling time, fewer than
            two periods are left, the motion does not repeat itself with this period, or the
            bandwidth is not between the period's frequency and half the sampling rate.
    """
    check_sampling(record)
    period, count = _samples_per_period(record, period)
    whole = record.t.size // count
    if skip < 0 or whole - skip < _FEWEST_PERIODS:
        raise InputError(
            f"{record.source}: {record.duration:.6g} s are {whole} whole periods of {period:g} s; "
            f"at least {_FEWEST_PERIODS} beside the first {max(skip, 0)}, which are left out, are "
            "required"
        )
    used = slice(skip * count, whole * count)
    q = record.q[used].reshape(whole - skip, count, record.dimension)
    tau = record.tau[used].reshape(q.shape)
    _check_repetition(record, q, period)
    bandwidth = HARMONICS_KEPT / period if bandwidth_hz is None else bandwidth_hz
    positions, velocities, accelerations = differentiate(q.mean(axis=0), period, bandwidth)
    return AveragedMotion(
        np.arange(count) * period / count,
        positions,
        velocities,
        accelerations,
        tau.mean(axis=0),
        _spread(tau),
        _spread(q),
        tau,
        period,
        bandwidth,
        record.joint_names,
    )


def differentiate(
    q: np.ndarray, period: float, bandwidth_hz: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a periodic signal below a bandwidth, and its first two derivatives.

    The discrete Fourier transform is multiplied by ``i omega`` and ``-omega^2`` and set to zero
    above the bandwidth, which is exact for signals without higher frequencies, Sec. 2.5.2.

    Args:
        q: One period, evenly sampled, shape (K, N).
        period: ``T_f`` [s].
        bandwidth_hz: ``f_g``, highest remaining frequency [Hz].

    Returns:
        Three arrays of shape (K, N).

    Raises:
        InputError: If the bandwidth is not between ``1 / T_f`` and half the sampling rate.
    """
    count = len(q)
    highest = 0.5 * count / period
    if not 1.0 / period * (1.0 - _ROUNDING) <= bandwidth_hz < highest:
        raise InputError(
            f"bandwidth = {bandwidth_hz:g} Hz; must be from {1.0 / period:g} Hz, the period's, to "
            f"below {highest:g} Hz, half the sampling rate"
        )
    frequencies = np.arange(count // 2 + 1) / period
    keep = frequencies <= bandwidth_hz * (1.0 + _ROUNDING)
    spectrum = np.fft.rfft(q, axis=0) * keep[:, None]
    rate = 2j * np.pi * frequencies[:, None]
    signals = [np.fft.irfft(rate**order * spectrum, count, axis=0) for order in range(3)]
    return signals[0], signals[1], signals[2]


def _samples_per_period(record: Record, period: float | None) -> tuple[float, int]:
    length = record.period if period is None else period
    if length is None:
        raise InputError(f"{record.source}: the period of the motion is not known; give one in s")
    if not 0.0 < length < np.inf:
        raise InputError(f"{record.source}: period = {length} s; must be positive and finite")
    samples = length / record.sampling_time
    count = round(samples)
    # rounding of the times in a file adds up over no more than the record
    if count < 1 or abs(samples - count) > max(_WHOLE * samples, _WHOLE):
        raise InputError(
            f"{record.source}: period = {length:g} s is {samples:.6g} sampling times of "
            f"{record.sampling_time:.6g} s; must be a whole number of them"
        )
    return float(length), count


def _check_repetition(record: Record, q: np.ndarray, period: float) -> None:
    travel = np.ptp(q, axis=(0, 1))
    deviation = np.sqrt(np.mean((q - q.mean(axis=0)) ** 2, axis=1)).max(axis=0)
    j = int(np.argmax(deviation - _REPEATS * travel))
    if deviation[j] > _REPEATS * travel[j]:
        raise InputError(
            f"{record.source}: q of {record.joint_names[j]} differs from period to period by "
            f"{deviation[j] / travel[j]:.3g} of its travel (RMS); {_REPEATS:g} is allowed: "
            f"the period is not {period:g} s, or the motion had not settled"
        )


def _spread(values: np.ndarray) -> np.ndarray:
    """Return the variance about the mean of the periods, shape (N,)."""
    periods, count, _ = values.shape
    squares: np.ndarray = np.sum((values - values.mean(axis=0)) ** 2, axis=(0, 1))
    return squares / ((periods - 1) * count)


_SURE = 5.0  # standard deviations


@dataclass(frozen=True, eq=False)
class FrictionTrend:
    """Change of friction from the first to the last averaged period; N joints.

    Attributes:
        coulomb: Change of ``f_c`` [Nm or N], shape (N,).
        viscous: Change of ``f_v`` [Nm s/rad or N s/m], shape (N,).
        coulomb_deviation: Standard deviation of ``coulomb``, shape (N,).
        viscous_deviation: Standard deviation of ``viscous``, shape (N,).
        significance: Size of both changes together, in standard deviations (root of the Mahalanobis
            distance from 0), shape (N,).
    """

    coulomb: np.ndarray
    viscous: np.ndarray
    coulomb_deviation: np.ndarray
    viscous_deviation: np.ndarray
    significance: np.ndarray

    @property
    def changes(self) -> np.ndarray:
        """Whether friction of a joint certainly changed, shape (N,)."""
        return self.significance > _SURE


def friction_trend(motion: AveragedMotion) -> FrictionTrend:
    """Return the change of friction from period to period.

    Differences between the periods of a repetitive motion do not come from inertia or gravity. The
    torques of period p are fitted, with the same means for all of them, by::

        tau_p(t) = tau(t) + (p - p_mean) (c sign(v(t)) + d v(t))

    and noise, which is assumed white; a coloured disturbance makes the deviations too small.

    Args:
        motion: P periods, P at least 2.

    Raises:
        InputError: If a joint does not move.
    """
    periods, count, joints = motion.tau_periods.shape
    steps = np.arange(periods) - 0.5 * (periods - 1)
    weight = float(steps @ steps)
    slope = np.einsum("p,pkn->kn", steps, motion.tau_periods)
    found, deviations, sure = np.empty((joints, 2)), np.empty((joints, 2)), np.empty(joints)
    for j, name in enumerate(motion.joint_names):
        v = motion.v[:, j]
        shape = np.column_stack([np.sign(v), v])
        normal = shape.T @ shape
        if np.linalg.matrix_rank(shape) < shape.shape[1]:
            raise InputError(f"{name} must move to and fro to show changes of friction")
        x = np.linalg.solve(normal, shape.T @ slope[:, j]) / weight
        around = motion.tau_periods[..., j] - motion.tau[:, j] - np.outer(steps, shape @ x)
        variance = np.sum(around**2) / ((periods - 1) * count - shape.shape[1])
        covariance = variance / weight * np.linalg.inv(normal)
        found[j], deviations[j] = x, np.sqrt(np.diag(covariance))
        # without any noise there is no reference for the comparison
        distance = x @ normal @ x * weight
        sure[j] = np.sqrt(distance / variance) if variance > 0.0 else (np.inf if x.any() else 0.0)
    found, deviations = (periods - 1) * found, (periods - 1) * deviations
    return FrictionTrend(found[:, 0], found[:, 1], deviations[:, 0], deviations[:, 1], sure)
