"""The smoothest surface near noisy points."""

import math
from collections.abc import Callable

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.surfaces.penalized_surface import PenalizedSurface

# Points out of the tolerance pull harder until they are in.
_PULLS, _LEAST_PULL, _STRONGEST = 60, 1.5, 1e9
_INSIDE = 0.995
# Part of all points that may be pulled: more are not stray, but the noise.
_FEW = 0.05


def smoothest_within(
    spline: PenalizedSurface,
    exponent: float,
    tolerance: float,
    distances: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray:
    """The smoothest penalized spline that misses no point by more than a tolerance.

    The penalty is the strongest that leaves all distances within it, but not weaker than the one
    that suits the noise: fitting more closely would follow that. Points that are still outside
    then get larger weights, if they are few.

    Args:
        spline: What is fitted; its weights may be changed.
        exponent: Decimal logarithm of the roughness that suits the noise, see
            `PenalizedSurface.best_predicting`.
        tolerance: Largest distance allowed, m.
        distances: Maps coefficients to the distances of all points, [n], m.

    Returns:
        Coefficients of the spline.

    Raises:
        InputError: Some point is further away even so, or one in twenty before weights.
    """

    def near(found: np.ndarray) -> bool:
        return bool(distances(found).max() <= _INSIDE * tolerance)

    coefficients = spline.fit(exponent)
    attainable = float(distances(coefficients).max())
    if near(coefficients):
        return spline.fit(spline.strongest(near, exponent))
    weights = spline.weights.copy()
    few = np.mean(distances(coefficients) > tolerance) <= _FEW
    for _ in range(_PULLS if few else 0):
        missed = distances(coefficients)
        outside = missed > _INSIDE * tolerance
        if not np.any(outside):
            return coefficients
        pull = np.maximum(_LEAST_PULL, (missed[outside] / tolerance) ** 2)
        weights[outside] = np.minimum(weights[outside] * pull, _STRONGEST)
        spline.weigh(weights)
        coefficients = spline.fit(exponent)
    missed = distances(coefficients)
    worst = int(np.argmax(missed))
    digits = 1 - math.floor(math.log10(attainable))
    enough = math.ceil(1.05 * attainable * 10.0**digits) / 10.0**digits
    raise InputError(
        f"tolerance: {tolerance:g} m: the points scatter more about every smooth surface, which"
        f" misses number {worst + 1} of those fitted by {missed[worst]:.3g} m: allow {enough:g} m,"
        " or take that point out"
    )
