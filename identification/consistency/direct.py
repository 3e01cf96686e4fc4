"""Consistent parameters straight from measurements, in one step."""

from dataclasses import dataclass

import numpy as np

from identification.consistency.bounds import PhysicalBounds
from identification.consistency.nearest import ConsistentParameters
from identification.consistency.program import PRIOR_WEIGHT, least_squares
from identification.estimation.least_squares import Estimate


@dataclass(frozen=True, eq=False)
class ConsistentEstimate(ConsistentParameters):
    """Consistent parameters that fit a motion best.

    Beside :class:`~identification.consistency.nearest.ConsistentParameters`, whose chi squared is
    by how much the weighted squares grow as the parameters are required to be consistent:

    Attributes:
        estimate: Base parameters that fit best without being consistent, from the same motion.
    """

    estimate: Estimate

    @property
    def robot_parameters(self) -> np.ndarray:
        """Those of the robot without terms of friction beyond Coulomb's and viscous, shape (n,)."""
        return self.parameters[: self.parameters.size - len(self.estimate.friction.terms)]

    @property
    def residuals(self) -> np.ndarray:
        """Measured less predicted torques [Nm or N], shape (K, N)."""
        system = self.estimate.system
        return system.torques - system.matrix @ self.base_values

    @property
    def weighted_squares(self) -> float:
        """Sum of squares of the residuals of torques that count, over their variances."""
        return float(np.sum((self.residuals * self.estimate.system.weights) ** 2))


def estimate_consistent(
    estimate: Estimate,
    bounds: PhysicalBounds,
    prior: np.ndarray | None = None,
    prior_weight: float = PRIOR_WEIGHT,
) -> ConsistentEstimate:
    """Return the consistent parameters with the least weighted squares (2.80) of the residuals.

    All torques that count enter by the factors of the weighted information matrix: with
    ``X = U F``, ``F = diag(values) V' diag(scale)``, ``|F K_b rho - U' b|^2`` and a constant are
    the weighted squares, see :func:`~identification.consistency.program.least_squares`. Noise is
    taken for white; for the metric of a covariance of coloured noise take
    :func:`~identification.consistency.nearest.nearest_consistent`.

    Args:
        estimate: What a motion tells about the base parameters.
        bounds: What is known of the bodies.
        prior: What parameters without effect tend to, shape (n,); by default the middle of the
            bounds.
        prior_weight: Weight of the distance from the prior beside the weighted squares.

    Raises:
        InputError: If the bounds are of another robot or cannot be kept, or the prior does not fit.
    """
    base, factors = estimate.base, estimate.factors
    F = factors.values[:, None] * factors.directions.T * factors.scale
    rho = least_squares(
        F @ base.projection, factors.right_side, base.full_names, bounds, prior, prior_weight
    )
    values = base.values(rho)
    change = values - estimate.base_parameters
    return ConsistentEstimate(
        names=list(base.full_names),
        parameters=rho,
        chi_squared=float(np.sum((F @ change) ** 2)),
        base_names=base.names,
        base_values=values,
        deviations=change / estimate.standard_deviation,
        prior_weight=prior_weight,
        estimate=estimate,
    )
