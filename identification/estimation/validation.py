"""Plausibility of an estimate: predicted motions, ground truth, impossible signs."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from identification.estimation.information import MeasuredMotion, information
from identification.estimation.least_squares import Estimate
from identification.model.base import BaseParameters
from identification.model.regressor import Regressor
from pfsc_drake.errors import InputError

_NEVER_NEGATIVE = ("f_c", "f_v", "I_M")
# standard deviations below zero that rule a parameter out; its torque must also exceed this part of
# the noise of a measurement
_SURE, _MATERIAL = 5.0, 0.2
# RMS of residuals in units of the noise of a measurement, and of the torques about their mean;
# above
# both of them a model does not explain the torques
_MOST_NOISE, _MOST_TORQUE = 4.0, 0.3
_SPEEDS = 50  # for the evaluation of friction with several terms


@dataclass(frozen=True, eq=False)
class PredictedTorque:
    """Torques of a model beside measured ones; K instants, N joints.

    Attributes:
        joint_names: N names.
        units: ``Nm`` or ``N`` of each joint.
        measured: Mean measured torques, shape (K, N).
        predicted: Torques of the model, shape (K, N).
        used: Whether a joint moves fast enough for its friction to be known, shape (K, N).
        torque_variance: Variance of one measured torque, shape (N,).
        mean_torque_variance: Variance of ``measured``, shape (N,).
        uncertainty: Standard deviation of ``predicted`` from the parameters' covariance, RMS of
            each joint, shape (N,).
    """

    joint_names: tuple[str, ...]
    units: tuple[str, ...]
    measured: np.ndarray
    predicted: np.ndarray
    used: np.ndarray
    torque_variance: np.ndarray
    mean_torque_variance: np.ndarray
    uncertainty: np.ndarray

    @property
    def residuals(self) -> np.ndarray:
        """Measured minus predicted torques, shape (K, N)."""
        return self.measured - self.predicted

    @property
    def rms(self) -> np.ndarray:
        """RMS of ``residuals``, all instants, shape (N,)."""
        return np.sqrt(np.mean(self.residuals**2, axis=0))

    @property
    def error_rms(self) -> np.ndarray:
        """RMS of single measured torques minus predicted ones, shape (N,), as in Tab. C.4."""
        return np.sqrt(self.rms**2 + self.torque_variance - self.mean_torque_variance)

    @property
    def noise_level(self) -> np.ndarray:
        """Standard deviation of one measured torque, shape (N,), as in Tab. C.4."""
        return np.sqrt(self.torque_variance)

    @property
    def explained(self) -> np.ndarray:
        """Share of the measured torques' variance that the model explains, shape (N,)."""
        return 1.0 - np.var(self.residuals, axis=0) / np.var(self.measured, axis=0)

    @property
    def variance_factor(self) -> np.ndarray:
        """Mean square of the used residuals in units of the noise's, shape (N,)."""
        squares = np.sum(np.where(self.used, self.residuals, 0.0) ** 2, axis=0)
        return squares / np.maximum(self.used.sum(axis=0), 1) / self.mean_torque_variance


def predict(
    estimate: Estimate,
    regressor: Regressor,
    motion: MeasuredMotion,
) -> PredictedTorque:
    """Return the torques that an estimate predicts for another motion.

    Args:
        estimate: Estimate of the robot.
        regressor: Regressor of the estimate, or an equal one.
        motion: The motion; need not excite all parameters.

    Raises:
        InputError: If the motion or the regressor do not fit the estimate.
    """
    system = information(regressor, estimate.robot_base, motion, estimate.friction)
    predicted = system.matrix @ estimate.base_parameters
    deviation = system.matrix @ np.linalg.cholesky(_regular(estimate.covariance))
    return PredictedTorque(
        estimate.joint_names,
        tuple("Nm" if unit == "rad" else "N" for unit in estimate.joint_units),
        system.torques,
        predicted,
        system.used,
        np.asarray(motion.torque_variance),
        np.asarray(motion.mean_torque_variance),
        np.sqrt(np.mean(np.sum(deviation**2, axis=2), axis=0)),
    )


def _regular(covariance: np.ndarray) -> np.ndarray:
    """Return a covariance without negative eigenvalues from rounding."""
    return covariance + np.diag(np.diag(covariance)) * 1e-12


@dataclass(frozen=True, eq=False)
class TruthTest:
    """Errors of an estimate beside their predicted covariance.

    Attributes:
        names: Names of the n_b used parameters.
        errors: Estimate minus ground truth, SI units, shape (n_b,).
        standard_errors: Errors in units of their standard deviations, shape (n_b,).
        chi_squared: ``e' C^-1 e``.
        degrees_of_freedom: n_b.
        p_value: Probability of a chi-squared at least as far from the middle, on either side.
    """

    names: list[str]
    errors: np.ndarray
    standard_errors: np.ndarray
    chi_squared: float
    degrees_of_freedom: int
    p_value: float


def compare_with_truth(estimate: Estimate, truth: np.ndarray, friction: bool = True) -> TruthTest:
    """Compare an estimate with the ground truth.

    Args:
        estimate: Estimate with covariance.
        truth: Ground truth, ``estimate.base.values(parameters)``, shape (n_b,).
        friction: Whether parameters of friction count, which may differ between runs, while those
            of the bodies stay the same.

    Raises:
        InputError: If the ground truth has another size or is not known.
    """
    names = estimate.short_names
    counts = [i for i, name in enumerate(names) if friction or ".f_" not in name]
    values = np.asarray(truth, dtype=float)
    if values.shape != estimate.base_parameters.shape:
        raise InputError(
            f"{estimate.robot}: truth of shape {values.shape}; must be "
            f"{estimate.base_parameters.shape}, base parameters as the estimate has them"
        )
    if not np.isfinite(values).all():
        name = names[int(np.argmin(np.isfinite(values)))]
        raise InputError(f"{estimate.robot}: the true {name} is not known; all must be")
    errors = (estimate.base_parameters - values)[counts]
    value = mahalanobis(errors, estimate.covariance[np.ix_(counts, counts)])
    size = len(errors)
    return TruthTest(
        [names[i] for i in counts],
        errors,
        errors / estimate.standard_deviation[counts],
        value,
        size,
        two_sided(value, size),
    )


def two_sided(chi_squared: float, freedom: int) -> float:
    """Return the probability of a chi-squared at least as far from the middle, on either side."""
    below, above = chi2.cdf(chi_squared, freedom), chi2.sf(chi_squared, freedom)
    return 2.0 * min(float(below), float(above))


def mahalanobis(errors: np.ndarray, covariance: np.ndarray) -> float:
    """Return ``e' C^-1 e``, computed with the correlations, whatever the units."""
    deviation = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(deviation, deviation)
    scaled = errors / deviation
    return float(scaled @ np.linalg.solve(correlation, scaled))


def refuse_implausible(estimate: Estimate) -> None:
    """Refuse an estimate that no robot has, or that does not explain the torques.

    Args:
        estimate: The estimate.

    Raises:
        InputError: If friction or a rotor's inertia is certainly below zero, or residuals are
            several times the noise of repetitions and not small compared to the torques.
    """
    robot, rank = estimate.robot_base, estimate.robot_base.rank
    spread = np.sqrt(max(estimate.variance_factor, 1.0))
    noise = np.sqrt(estimate.motion.torque_variance)
    columns = estimate.system.matrix[..., :rank] / noise[:, None]
    found = never_negative(
        robot,
        estimate.base_parameters[:rank],
        estimate.standard_deviation[:rank] * spread,
        np.sqrt(np.mean(np.sum(columns**2, axis=1), axis=0)),
        [f"joint_{term.joint + 1}" for term in estimate.friction.terms],
    ) or _driving_friction(estimate, spread)
    if found is not None:
        raise InputError(
            f"{estimate.robot}: {describe_negative(*found)}: sign of tau or q, the model's axes, "
            "or friction of another form (check it with a record for --validation)"
        )
    _refuse_unexplained(estimate, noise)


def never_negative(
    base: BaseParameters,
    parameters: np.ndarray,
    deviation: np.ndarray,
    sizes: np.ndarray,
    but: list[str] | None = None,
) -> tuple[str, str, float, float] | None:
    """Return the surest negative value that is impossible: name, unit, value, deviation.

    Friction and rotor inertia count if torques distinguish them from all other parameters.

    Args:
        base: Combinations of the parameters.
        parameters: Shape (n_b,).
        deviation: Standard deviations of the parameters, shape (n_b,).
        sizes: RMS of the torque of a parameter of one, in units of the noise of one measurement,
            shape (n_b,).
        but: Joints whose friction has further terms, so that no single parameter decides.
    """
    below = [
        i
        for i, (name, row) in enumerate(zip(base.short_names, base.projection, strict=True))
        if name.split(".")[1] in _NEVER_NEGATIVE
        and not (name.split(".")[0] in (but or []) and ".f_" in name)
        and np.count_nonzero(row) == 1
        and parameters[i] < -_SURE * deviation[i]
        and -parameters[i] * sizes[i] > _MATERIAL
    ]
    if not below:
        return None
    i = min(below, key=lambda i: float(parameters[i] / deviation[i]))
    return base.short_names[i], base.units[i], float(parameters[i]), float(deviation[i])


def describe_negative(name: str, unit: str, value: float, deviation: float) -> str:
    """Return a sentence about an impossible negative value.

    Args:
        name: Name of the parameter.
        unit: Unit of the parameter.
        value: Value of the parameter.
        deviation: Standard deviation of the value.
    """
    return (
        f"{name} = {value:.3g} {unit}, {-value / deviation:.0f} standard deviations below zero, "
        "and cannot be negative"
    )


def _driving_friction(estimate: Estimate, spread: float) -> tuple[str, str, float, float] | None:
    """Return the joint and velocity at which friction of several terms certainly drives."""
    base, still = estimate.base, estimate.system.still
    for j in sorted({term.joint for term in estimate.friction.terms}):
        own = [i for i, name in enumerate(base.short_names) if name.startswith(f"joint_{j + 1}.f_")]
        fastest = float(np.abs(estimate.motion.v[:, j]).max())
        if still[j] or not fastest > 0.0:
            continue
        sign = np.repeat([1.0, -1.0], _SPEEDS)
        v = sign * np.tile(np.linspace(0.1, 1.0, _SPEEDS) * fastest, 2)
        columns = {f"joint_{j + 1}.f_c": sign, f"joint_{j + 1}.f_v": v}
        columns |= {t.name: t.column(v) for t in estimate.friction.terms if t.joint == j}
        A = sign[:, None] * np.column_stack([columns[base.short_names[i]] for i in own])
        braking = A @ estimate.base_parameters[own]
        covariance = estimate.covariance[np.ix_(own, own)]
        deviation = spread * np.sqrt(np.einsum("kp,pq,kq->k", A, covariance, A))
        noise = float(np.sqrt(estimate.motion.torque_variance[j]))
        drives = (braking < -_SURE * deviation) & (-braking > _MATERIAL * noise)
        if drives.any():
            k = int(np.argmax(drives))
            unit = "Nm" if estimate.joint_units[j] == "rad" else "N"
            what = f"friction of {estimate.joint_names[j]} against {v[k]:.3g} "
            what += f"{estimate.joint_units[j]}/s"
            return what, unit, float(braking[k]), float(deviation[k])
    return None


def _refuse_unexplained(estimate: Estimate, noise: np.ndarray) -> None:
    used = estimate.system.used
    count = np.maximum(used.sum(axis=0), 1)
    rms = np.sqrt(np.sum(np.where(used, estimate.residuals, 0.0) ** 2, axis=0) / count)
    torque = np.std(estimate.system.torques, axis=0)
    excess = np.minimum(rms / (_MOST_NOISE * noise), rms / (_MOST_TORQUE * torque))
    j = int(np.argmax(np.where(np.isfinite(excess), excess, 0.0)))
    if excess[j] > 1.0:
        raise InputError(
            f"{estimate.robot}: residual of tau of {estimate.joint_names[j]}: "
            f"{rms[j] / noise[j]:.3g} times the noise of repetitions ({_MOST_NOISE:g} is allowed) "
            f"and {100.0 * rms[j] / torque[j]:.2g} % of the torque ({100.0 * _MOST_TORQUE:g} % is "
            "allowed), which no sign, order or unit of a signal explains: axes, zeros or gravity "
            "of the model, unmodelled forces on the robot, or friction of another form (check it "
            "with a record for --validation)"
        )
