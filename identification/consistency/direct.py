"""Consistent parameters straight from measurements, in one step."""

from dataclasses import dataclass

import numpy as np

from identification.consistency.bounds import PhysicalBounds
from identification.consistency.nearest import ConsistentParameters
from identification.consistency.program import PRIOR_WEIGHT, least_squares
from identification.measurement.periods import AveragedMotion
from identification.model.base import BaseParameters
from identification.model.regressor import Regressor
from pfsc_drake.errors import InputError

# reciprocal condition number of scaled columns; below, some combination has no effect
_SINGULAR = 1e-10


@dataclass(frozen=True, eq=False)
class ConsistentEstimate(ConsistentParameters):
    """Consistent parameters that fit a motion best.

    Beside :class:`~identification.consistency.nearest.ConsistentParameters`, whose chi squared is
    by how much the weighted squares grow as the parameters are required to be consistent:

    Attributes:
        free_values: Base parameters that fit best without being consistent, shape (n_b,).
        covariance: Of those, from the variance of the torques, shape (n_b, n_b).
        weighted_squares: Sum of squares of the residuals that count over their standard deviations.
        residuals: Measured less predicted torques [Nm or N], shape (K, N).
    """

    free_values: np.ndarray
    covariance: np.ndarray
    weighted_squares: float
    residuals: np.ndarray


def estimate_consistent(
    regressor: Regressor,
    base: BaseParameters,
    motion: AveragedMotion,
    bounds: PhysicalBounds,
    prior: np.ndarray | None = None,
    prior_weight: float = PRIOR_WEIGHT,
    variance: np.ndarray | None = None,
    used: np.ndarray | None = None,
) -> ConsistentEstimate:
    """Return the consistent parameters with the least weighted squares (2.80) of the residuals.

    The K N equations are reduced to n_b by ``[W Y_b, W tau] = Q [R, c; 0, r]``, so that
    ``|R K_b rho - c|^2 + r^2`` remains, see
    :func:`~identification.consistency.program.least_squares`.

    Args:
        regressor: Of the robot.
        base: Its base parameters, of the same parameters.
        motion: What was measured, K samples.
        bounds: What is known of the bodies.
        prior: What parameters without effect tend to, shape (n,); by default the middle of the
            bounds.
        prior_weight: Weight of the distance from the prior beside the weighted squares.
        variance: Of the torques [Nm^2 or N^2], shape (N,); by default from the spread over the
            periods of the motion.
        used: Which torques count, shape (K, N), such as those of joints that move, since dry
            friction about standstill has no sign; by default all.

    Raises:
        InputError: If shapes do not fit, a variance is not positive, the motion does not excite a
            combination of parameters, or the bounds cannot be kept.
    """
    n = regressor.subject.dimension
    if base.full_names != regressor.names:
        raise InputError(
            f"base parameters: of {len(base.full_names)} parameters; must be those of the "
            f"regressor, {regressor.size}"
        )
    variance = np.asarray(motion.mean_torque_variance if variance is None else variance)
    if variance.shape != (n,) or not np.all((variance > 0.0) & np.isfinite(variance)):
        raise InputError(f"variance = {variance.tolist()}; must be {n} positive numbers")
    tau = np.asarray(motion.tau, dtype=float)
    if tau.shape != np.shape(motion.q) or not np.all(np.isfinite(tau)):
        raise InputError(f"tau: shape {tau.shape}; must be finite numbers, as many as positions")
    used = np.ones(tau.shape, dtype=bool) if used is None else np.asarray(used, dtype=bool)
    if used.shape != tau.shape:
        raise InputError(f"used: shape {used.shape}; must be {tau.shape}, as the torques")
    Y_b = base.reduce(regressor.matrix(motion.q, motion.v, motion.a))
    weights = used / np.sqrt(variance)
    rows = (weights[:, :, None] * Y_b).reshape(-1, base.rank)
    equations = np.column_stack([rows, (weights * tau).ravel()])
    system = np.asarray(np.linalg.qr(equations, mode="r"))
    R, c = system[: base.rank, : base.rank], system[: base.rank, -1]
    _require_excited(base, R)
    inverse = np.linalg.inv(R)
    free, covariance = inverse @ c, inverse @ inverse.T
    rho = least_squares(R @ base.projection, c, base.full_names, bounds, prior, prior_weight)
    values = base.values(rho)
    residuals = tau - Y_b @ values
    return ConsistentEstimate(
        names=list(base.full_names),
        parameters=rho,
        chi_squared=float(np.sum((R @ (values - free)) ** 2)),
        base_names=base.names,
        base_values=values,
        deviations=(values - free) / np.sqrt(np.diag(covariance)),
        prior_weight=prior_weight,
        free_values=free,
        covariance=covariance,
        weighted_squares=float(np.sum((weights * residuals) ** 2)),
        residuals=residuals,
    )


def _require_excited(base: BaseParameters, R: np.ndarray) -> None:
    norms = np.linalg.norm(R, axis=0)
    if R.shape[0] < base.rank:
        raise InputError(f"motion: {R.shape[0]} equations; must be at least {base.rank}")
    _, sizes, directions = np.linalg.svd(R / np.where(norms > 0.0, norms, 1.0))
    if sizes[-1] <= _SINGULAR * sizes[0]:
        strongest = np.argsort(-np.abs(directions[-1]))[:3]
        named = ", ".join(base.short_names[i] for i in strongest)
        raise InputError(
            f"motion: does not excite {named}, whose torques cannot be told apart; allowed: one "
            "that moves all joints independently"
        )
