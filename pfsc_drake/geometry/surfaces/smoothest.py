"""The smoothest heights near noisy ones."""

import math
from typing import NamedTuple

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.surfaces.penalized_surface import PenalizedSurface
from pfsc_drake.geometry.surfaces.spline_surface import UniformKnots

# Values out of the tolerance pull harder until they are in.
_PULLS, _LEAST_PULL, _STRONGEST = 60, 1.5, 1e9
_INSIDE = 0.995


class SmoothHeights(NamedTuple):
    """A spline near values.

    Attributes:
        coefficients: [first.count * second.count].
        noise: Standard deviation of the values that cross-validation takes for noise.
    """

    coefficients: np.ndarray
    noise: float


def smoothest_heights(
    theta: np.ndarray,
    values: np.ndarray,
    first: UniformKnots,
    second: UniformKnots,
    tolerance: float | None,
    slopes: np.ndarray | None = None,
) -> SmoothHeights:
    """The smoothest penalized spline that the noise or a tolerance allows.

    Without a tolerance the penalty is that of `PenalizedSurface.best_predicting`. With one it is
    the strongest that leaves all residuals within it, but not weaker than that: fitting more
    closely would follow the noise. Values that are still outside then get larger weights.

    Args:
        theta: [n, 2].
        values: [n].
        first: Knots of theta_1.
        second: Knots of theta_2.
        tolerance: Largest residual allowed, None for the noise alone.
        slopes: What residuals are multiplied with, [n], positive; by default one.

    Raises:
        InputError: Some residual exceeds the tolerance even so.
    """
    scale = np.ones(len(values)) if slopes is None else slopes
    spline = PenalizedSurface(theta, values, first, second)
    spline.weigh(scale**2)
    exponent, noise = spline.best_predicting()
    coefficients = spline.fit(exponent)
    if tolerance is None:
        return SmoothHeights(coefficients, noise)

    def misses(found: np.ndarray) -> np.ndarray:
        return np.asarray(np.abs(spline.residuals(found)) * scale)

    def near(found: np.ndarray) -> bool:
        return bool(misses(found).max() <= _INSIDE * tolerance)

    attainable = float(misses(coefficients).max())
    if near(coefficients):
        return SmoothHeights(spline.fit(spline.strongest(near, exponent)), noise)
    weights = scale**2
    for _ in range(_PULLS):
        missed = misses(coefficients)
        outside = missed > _INSIDE * tolerance
        if not np.any(outside):
            return SmoothHeights(coefficients, noise)
        pull = np.maximum(_LEAST_PULL, (missed[outside] / tolerance) ** 2)
        weights[outside] = np.minimum(weights[outside] * pull, _STRONGEST)
        spline.weigh(weights)
        coefficients = spline.fit(exponent)
    worst = int(np.argmax(misses(coefficients)))
    digits = 1 - math.floor(math.log10(attainable))
    enough = math.ceil(1.05 * attainable * 10.0**digits) / 10.0**digits
    raise InputError(
        f"tolerance: {tolerance:g} m: the points scatter more about every smooth surface, by"
        f" {noise:.2g} m on average, and number {worst + 1} of those fitted by"
        f" {misses(coefficients)[worst]:.3g} m: allow {enough:g} m, or take that point out"
    )
