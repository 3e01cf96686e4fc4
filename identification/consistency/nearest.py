"""Physically consistent parameters: nearest to identified ones, or directly from measurements."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from identification.consistency.bounds import PhysicalBounds
from identification.consistency.semidefinite_program import PRIOR_WEIGHT, least_squares
from identification.estimation.least_squares import Estimate
from identification.model.base import BaseParameters
from pfsc_drake.checks import require, require_numbers
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.rules import Parameters, Range

# of a covariance matrix scaled to ones on its diagonal; below, it is singular up to rounding
_SINGULAR = 1e-13
# largest plausible chi squared of each base parameter: ten standard deviations; Tab. C.3 has 26
_FAR = 100.0


@dataclass(frozen=True, eq=False)
class Prediction(Parameters):
    """Torques to predict in agreement with the identified base parameters.

    Tables of standard deviations lack the correlations, and thus the directions in which parameters
    may change together without an effect on torques. A few predicted torques restore them.

    Attributes:
        matrices: Regression matrices ``Y_b`` of a motion, shape (K, N, n_b).
        standard_deviation: Standard deviation of the torques [Nm or N], shape (N,).
        weight: Number of measurements of each torque that the motion counts for.

    Raises:
        InputError: If shapes do not fit each other, or a number is out of range.
    """

    matrices: np.ndarray
    standard_deviation: np.ndarray
    weight: Annotated[float, Range(0.0, words="finite and not negative")]

    def __post_init__(self) -> None:
        super().__post_init__()
        sigma, shape = np.asarray(self.standard_deviation), np.shape(self.matrices)
        if len(shape) != 3 or sigma.shape != shape[1:2] or not np.all(np.isfinite(self.matrices)):
            raise InputError(
                f"prediction: matrices {shape}, deviations {sigma.shape}; must be (K, N, n_b) and "
                "(N,), all finite"
            )
        require_numbers("standard_deviation", sigma, shape[1])
        require(bool(np.all(sigma > 0.0)), "standard_deviation", sigma, "positive")

    def factor(self) -> np.ndarray:
        """Return R with ``|R d|^2`` the weighted squares of torques for ``d``, shape (r, n_b)."""
        samples, _, columns = self.matrices.shape
        rows = self.matrices / self.standard_deviation[:, None]
        return np.sqrt(self.weight / samples) * np.linalg.qr(rows.reshape(-1, columns), mode="r")


@dataclass(frozen=True, eq=False)
class ConsistentParameters:
    """A physically consistent set of n parameters.

    Attributes:
        names: Names of the parameters.
        parameters: ``rho``, SI units, shape (n,).
        chi_squared: ``|L^-1 (K_b rho - rho_b)|^2`` with the covariance ``L L'`` of the base
            parameters ``rho_b``: distance from the measurement.
        base_names: Names of the n_b base parameters, in words.
        base_values: ``K_b rho``, shape (n_b,).
        deviations: ``K_b rho - rho_b`` in standard deviations of each, shape (n_b,).
    """

    names: list[str]
    parameters: np.ndarray
    chi_squared: float
    base_names: list[str]
    base_values: np.ndarray
    deviations: np.ndarray


def nearest_consistent(
    base: BaseParameters,
    values: np.ndarray,
    covariance: np.ndarray,
    bounds: PhysicalBounds,
    prior: np.ndarray | None = None,
    prior_weight: float = PRIOR_WEIGHT,
    prediction: Prediction | None = None,
) -> ConsistentParameters:
    """Return the consistent parameters nearest to base parameters.

    The distance is in the metric of the covariance: the set is the most likely one among the
    consistent ones, up to the small weight of the prior; see
    :func:`~identification.consistency.semidefinite_program.least_squares`.

    Args:
        base: Base of the robot, or other combinations of its parameters.
        values: Identified base parameters ``rho_b``, shape (n_b,).
        covariance: Covariance of the values, shape (n_b, n_b).
        bounds: Bounds of the bodies.
        prior: Values for parameters without effect, shape (n,); by default the middle of the
            bounds.
        prior_weight: Weight of the distance from the prior beside chi squared.
        prediction: Torques that count beside chi squared.

    Raises:
        InputError: If a shape is wrong, a number not finite, the covariance not positive definite,
            or the bounds cannot be met.
    """
    values = check_values(base, values)
    L = factor(base, covariance)
    A, b = np.linalg.solve(L, base.projection), np.linalg.solve(L, values)
    if prediction is not None:
        if prediction.matrices.shape[2] != base.rank:
            raise InputError(
                f"prediction: matrices {prediction.matrices.shape}; must have {base.rank} columns"
            )
        R = prediction.factor()
        A, b = np.vstack([A, R @ base.projection]), np.concatenate([b, R @ values])
    rho = least_squares(A, b, base.full_names, bounds, prior, prior_weight)
    residual = base.projection @ rho - values
    return ConsistentParameters(
        names=list(base.full_names),
        parameters=rho,
        chi_squared=float(np.sum(np.linalg.solve(L, residual) ** 2)),
        base_names=base.names,
        base_values=base.projection @ rho,
        deviations=residual / np.linalg.norm(L, axis=1),
    )


def refuse_far(found: ConsistentParameters, source: str) -> None:
    """Refuse a consistent set that is far from the measurement.

    Args:
        found: The set.
        source: Source of the measurement.

    Raises:
        InputError: If chi squared is far above the number of base parameters; names the parameters
            with the largest deviations.
    """
    count = len(found.base_values)
    if found.chi_squared <= _FAR * count:
        return
    worst = np.argsort(-np.abs(found.deviations))[:3]
    names = ", ".join(
        f"{found.base_names[i].split()[0]} ({found.deviations[i]:+.3g} standard deviations)"
        for i in worst
    )
    raise InputError(
        f"{source}: the nearest robot that can be has chi squared {found.chi_squared:.3g} of "
        f"{count} base parameters; allowed: {_FAR * count:.4g}; furthest off: {names}: signs, "
        "order or units of the signals, the model's axes, or bounds of its bodies"
    )


def check_values(base: BaseParameters, values: np.ndarray) -> np.ndarray:
    """Return base parameters as an array, shape (n_b,).

    Raises:
        InputError: If their number differs from the base, or one is not finite.
    """
    values = np.asarray(values, dtype=float)
    if values.shape != (base.rank,):
        raise InputError(f"base parameters: shape {values.shape}; must be ({base.rank},)")
    if not np.all(np.isfinite(values)):
        first = int(np.argmin(np.isfinite(values)))
        raise InputError(
            f"base parameters: {base.short_names[first]} is {values[first]}; must be finite"
        )
    return values


def factor(base: BaseParameters, covariance: np.ndarray) -> np.ndarray:
    """Return the lower triangular ``L`` with the covariance ``L L'``, shape (n_b, n_b).

    Args:
        base: Base parameters of the covariance.
        covariance: Shape (n_b, n_b).

    Raises:
        InputError: If it has another shape, is not symmetric or not positive definite.
    """
    C, n = np.asarray(covariance, dtype=float), base.rank
    if C.shape != (n, n):
        raise InputError(f"covariance: shape {C.shape}; must be ({n}, {n})")
    variances = np.diag(C)
    if not (np.all(np.isfinite(C)) and np.all(variances > 0.0)):
        fine = (variances > 0.0) & np.all(np.isfinite(C), axis=1)
        first = int(np.argmin(fine))
        raise InputError(
            f"covariance: variance of {base.short_names[first]} is {variances[first]:g}; must be "
            "positive, and all entries finite"
        )
    sigma = np.sqrt(variances)
    R = C / np.outer(sigma, sigma)
    asymmetry = float(np.abs(R - R.T).max())
    if asymmetry > np.sqrt(_SINGULAR):
        raise InputError(f"covariance: not symmetric, by {asymmetry:.3g} of the variances")
    least = float(np.linalg.eigvalsh(R)[0])
    if least <= _SINGULAR:
        raise InputError(
            f"covariance: least eigenvalue {least:.3g} of the correlation matrix; must be positive"
        )
    return sigma[:, None] * np.linalg.cholesky(R)


def estimate_consistent(
    estimate: Estimate,
    bounds: PhysicalBounds,
    prior_weight: float = PRIOR_WEIGHT,
) -> ConsistentParameters:
    """Return the consistent parameters with the least weighted squares (2.80) of the residuals.

    All used torques enter by the factors of the weighted information matrix: with ``X = U F``,
    ``F = diag(values) V' diag(scale)``, ``|F K_b rho - U' b|^2`` and a constant are the weighted
    squares, see :func:`~identification.consistency.semidefinite_program.least_squares`. Noise is
    assumed white; for the metric of a covariance of coloured noise use :func:`nearest_consistent`.
    Chi squared is the increase of the weighted squares by the requirement of consistency.

    Args:
        estimate: Estimate of the base parameters from a motion.
        bounds: Bounds of the bodies.
        prior_weight: As in :func:`nearest_consistent`, beside the weighted squares.

    Raises:
        InputError: If the bounds belong to another robot or cannot be met.
    """
    base, factors = estimate.base, estimate.factors
    F = factors.values[:, None] * factors.directions.T * factors.scale
    rho = least_squares(
        F @ base.projection,
        factors.right_side,
        base.full_names,
        bounds,
        prior_weight=prior_weight,
    )
    values = base.values(rho)
    change = values - estimate.base_parameters
    return ConsistentParameters(
        names=list(base.full_names),
        parameters=rho,
        chi_squared=float(np.sum((F @ change) ** 2)),
        base_names=base.names,
        base_values=values,
        deviations=change / estimate.standard_deviation,
    )
