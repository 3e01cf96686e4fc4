"""Weighted least squares for the base parameters (2.80), with weights and covariance."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.stats import chi2

from identification.estimation.friction_terms import FrictionTerms
from identification.estimation.identifiability import (
    Factors,
    WeakParameter,
    factorize,
    weak_parameters,
)
from identification.estimation.information import SLOW, Information, MeasuredMotion, information
from identification.model.base import BaseParameters
from identification.model.regressor import Regressor

# neighbours on either side for the average of a spectrum
_SMOOTH = 10
# first harmonics of bands with equal power of white noise
_BANDS = (1, 11, 41, 161, 641)
# probability to classify white noise as coloured, for a band of a joint
_ERROR = 1e-5


def mean_torque_spectrum(motion: MeasuredMotion) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the spectrum of the noise in the mean torques; None if there are no periods.

    Differences between the periods are noise; everything common to all periods is excluded, so that
    a wrong model has no effect. The power is given at the harmonics of the period, averaged over
    some neighbours; over all of them in joints whose noise has equal power in all frequency bands,
    up to chance.

    Args:
        motion: Motion with torques of P periods as ``tau_periods``, shape (P, K, N), or without.

    Returns:
        Variances per sample [(Nm)^2 or N^2] at the frequencies of ``rfft``, shape
        (K // 2 + 1, N), the same at all frequencies for white noise; and whether the noise of a
        joint is coloured, shape (N,).
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
    return np.where(white, flat, (sums[width:] - sums[:-width]) / width), ~white


def coloured_covariance(inverse: np.ndarray, system: Information, powers: np.ndarray) -> np.ndarray:
    """Return the covariance of the weighted least-squares estimate under coloured noise.

    ``(X' W X)^-1 X' W E W X (X' W X)^-1`` with the covariance E of the torques, which is diagonal
    in the frequencies for a periodic motion.

    Args:
        inverse: ``(X' W X)^-1``, shape (n_b, n_b).
        system: The linear system.
        powers: Powers of the noise, see :func:`mean_torque_spectrum`, shape (K // 2 + 1, N).
    """
    samples = len(system.matrix)
    both = np.full(len(powers), 2.0)
    both[0] = 1.0
    if samples % 2 == 0:
        both[-1] = 1.0
    middle = np.zeros_like(inverse)
    for j, (variance, power) in enumerate(zip(system.variance, powers.T, strict=True)):
        column = system.matrix[:, j] * (system.used[:, j] / variance)[:, None]
        parts = np.fft.rfft(column, axis=0) * np.sqrt(both * power / samples)[:, None]
        middle += (parts.conj().T @ parts).real
    covariance = inverse @ middle @ inverse
    return 0.5 * (covariance + covariance.T)


@dataclass(frozen=True, eq=False)
class Estimate:
    """Base parameters of a robot from one experiment; K instants, N joints, n_b parameters.

    Attributes:
        robot: Name of the robot.
        joint_names: N names.
        joint_units: ``rad`` or ``m`` of each joint.
        base: Combinations of the parameters; those of ``friction`` are the last ones.
        friction: Terms beside Coulomb and viscous friction.
        base_parameters: ``rho_b`` of (2.80), shape (n_b,), SI units.
        covariance: Covariance of ``base_parameters``, shape (n_b, n_b).
        coloured: In which joints the covariance uses the measured noise spectrum, shape (N,). In
            the others noise is white; if in all of them, ``(X' Upsilon^-1 X)^-1`` is the
            covariance.
        motion: Motion of the estimate.
        system: The linear system that was solved.
        factors: Its singular values.
    """

    robot: str
    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]
    base: BaseParameters
    friction: FrictionTerms
    base_parameters: np.ndarray
    covariance: np.ndarray
    coloured: np.ndarray
    motion: MeasuredMotion
    system: Information
    factors: Factors

    @property
    def names(self) -> list[str]:
        """Combination of each parameter."""
        return self.base.names

    @property
    def short_names(self) -> list[str]:
        """Leading parameter of each combination."""
        return self.base.short_names

    @property
    def units(self) -> list[str]:
        """Units of the parameters."""
        return self.base.units

    @property
    def robot_base(self) -> BaseParameters:
        """Base parameters without ``friction``: the first ones, with their covariance."""
        rank, full = (size - len(self.friction.terms) for size in self.base.projection.shape)
        return BaseParameters(
            self.base.indices[:rank],
            self.base.projection[:rank, :full],
            self.base.full_names[:full],
            self.base.full_units[:full],
        )

    @property
    def standard_deviation(self) -> np.ndarray:
        """Standard deviations of the parameters, shape (n_b,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def relative_standard_deviation(self) -> np.ndarray:
        """Standard deviations in units of the magnitudes, shape (n_b,)."""
        return self.standard_deviation / np.abs(self.base_parameters)

    @cached_property
    def prediction(self) -> np.ndarray:
        """Torques of the model on the motion [Nm or N], shape (K, N)."""
        return self.system.matrix @ self.base_parameters

    @property
    def residuals(self) -> np.ndarray:
        """Measured less predicted torques [Nm or N], shape (K, N)."""
        return self.system.torques - self.prediction

    @property
    def degrees_of_freedom(self) -> int:
        """Number of used torques minus number of parameters."""
        return int(np.count_nonzero(self.system.used)) - self.base.rank

    @property
    def variance_factor(self) -> float:
        """Mean square of the weighted residuals; 1 for pure noise."""
        squares = np.sum((self.residuals * self.system.weights) ** 2)
        return float(squares / self.degrees_of_freedom)

    @property
    def condition(self) -> float:
        """Condition number of the weighted information matrix with columns of length 1."""
        return self.factors.condition

    def weak_parameters(self) -> list[WeakParameter]:
        """Return the badly identifiable parameters with reasons, the worst first."""
        return weak_parameters(
            self.system.matrix,
            self.system.weights,
            np.sqrt(self.motion.torque_variance),
            self.base_parameters,
            self.covariance,
            self.short_names,
            self.joint_names,
        )


def estimate(
    regressor: Regressor,
    base: BaseParameters,
    motion: MeasuredMotion,
    friction: FrictionTerms | None = None,
    slow: float = SLOW,
    white: bool = False,
) -> Estimate:
    """Estimate base parameters by weighted least squares (2.80).

    The torques of each joint are weighted with their variance. The covariance for white noise is
    ``(X' Upsilon^-1 X)^-1``; if the periods of a motion show coloured noise, the covariance of the
    same estimate for the measured noise spectrum is larger.

    Args:
        regressor: Regressor of the robot.
        base: Its base parameters.
        motion: Positions, velocities, accelerations and torques.
        friction: Terms beside Coulomb and viscous friction.
        slow: Part of a joint's largest velocity below which its torques do not count, because the
            joint may stick.
        white: Whether to assume white noise even if the periods show coloured noise.

    Raises:
        InputError: If the motion does not fit the robot, or does not excite all parameters (names
            those that cannot be distinguished).
    """
    system = information(regressor, base, motion, friction, slow)
    subject = regressor.subject
    factors = factorize(*system.weighted(), system.base.short_names, _source(system, regressor))
    covariance = factors.inverse()
    spectrum = None if white else mean_torque_spectrum(motion)
    coloured = np.zeros(subject.dimension, dtype=bool)
    if spectrum is not None and spectrum[1].any():
        powers, coloured = spectrum
        covariance = coloured_covariance(covariance, system, powers)
    return Estimate(
        subject.name,
        tuple(subject.joint_names),
        tuple(subject.joint_units),
        system.base,
        friction or FrictionTerms(),
        factors.solution(),
        covariance,
        coloured,
        motion,
        system,
        factors,
    )


def _source(system: Information, regressor: Regressor) -> str:
    names = regressor.subject.joint_names
    still = [name for name, stands in zip(names, system.still, strict=True) if stands]
    return regressor.subject.name + (f", {', '.join(still)} standing still" if still else "")


# below this part of the largest, an eigenvalue is zero up to rounding
_RANK = 1e-12


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Parameters and residual squares, linear in factors s of the torques of N joints.

    With ``tau_j`` in the rows of joint j as column j of C and the weighted regressor X, the
    parameters are ``(X' X)^-1 X' C s``, and the residual squares are ``s' M s`` with
    ``M = C' C - C' X (X' X)^-1 X' C``.

    Attributes:
        residual_squares: M in units of the noise, shape (N, N).
        parameters: ``(X' X)^-1 X' C``, shape (n_b, N).
        deviation: Standard deviations of the parameters, shape (n_b,); infinite for those that
            torques do not distinguish.
        sizes: RMS of the torque of a parameter of one, in units of the noise, shape (n_b,).
        freedom: Number of used torques minus number of parameters.
    """

    residual_squares: np.ndarray
    parameters: np.ndarray
    deviation: np.ndarray
    sizes: np.ndarray
    freedom: int

    @classmethod
    def of(
        cls, matrix: np.ndarray, v: np.ndarray, tau: np.ndarray, noise: np.ndarray
    ) -> "NormalEquations":
        """Return the equations of a motion of K instants; torques of slow joints do not count.

        Args:
            matrix: ``Y_b``, shape (K, N, n_b).
            v: Velocities, shape (K, N).
            tau: Torques, shape (K, N).
            noise: Their standard deviations, shape (N,).
        """
        samples, joints = tau.shape
        fastest = np.abs(v).max(axis=0)
        used = (np.abs(v) >= SLOW * fastest) & (fastest > 0.0)
        weight = used / noise
        X = (matrix * weight[..., None]).reshape(samples * joints, -1)
        lengths = np.linalg.norm(X, axis=0)
        scale = np.where(lengths > 0.0, lengths, 1.0)
        X /= scale
        values, vectors = np.linalg.eigh(X.T @ X)
        known = values > _RANK * max(float(values[-1]), np.finfo(float).tiny)
        root = vectors[:, known] / np.sqrt(values[known])
        weighted = tau * weight
        right = np.einsum("kjp,kj->pj", X.reshape(samples, joints, -1), weighted)
        parameters = root @ (root.T @ right)
        blind = np.linalg.norm(vectors[:, ~known], axis=1) > np.sqrt(_RANK)
        deviation = np.linalg.norm(root, axis=1) / scale
        return cls(
            np.diag(np.sum(weighted**2, axis=0)) - right.T @ parameters,
            parameters / scale[:, None],
            np.where(blind, np.inf, deviation),
            lengths / np.sqrt(samples),
            max(int(used.sum()) - int(known.sum()), 1),
        )
