"""Distances of points from surfaces fitted by penalized splines, and fits within a tolerance."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.penalized_spline import PenalizedSpline
from pfsc_drake.geometry.surfaces.parametric_surface import Surface, partial_index

_STEPS = 12
# Of a parameter relative to its domain.
_CONVERGED = 1e-13
# A stray point is so many standard deviations away, and so many spacings.
_STRAY, _STRAY_SPACINGS = 10.0, 0.1
# Median of the absolute value of a normal random number of deviation one.
_MEDIAN_OF_NORMAL = 0.6745
# Mean of the absolute value over the root mean square: 0.80 of normal noise, 1 of two sheets.
_TWO_SHEETS = 0.93


@dataclass(frozen=True)
class Residuals:
    """Positions of points relative to a surface.

    Attributes:
        theta: Parameters of the closest points of the surface, [n, 2].
        distances: Distances along the normal (4.3), positive on its side, m, [n].
    """

    theta: np.ndarray
    distances: np.ndarray

    @property
    def rms(self) -> float:
        """Root mean square of the distances, m."""
        return float(np.sqrt(np.mean(self.distances**2)))

    @property
    def largest(self) -> float:
        """Largest distance, m."""
        return float(np.abs(self.distances).max())


def residuals(surface: Surface, points: np.ndarray, theta: np.ndarray) -> Residuals:
    """Return the distances of points from a surface.

    Args:
        surface: The surface.
        points: [n, 3], m, near it.
        theta: Guesses of their parameters, [n, 2].

    Returns:
        The residuals; for points beyond an end the distances along the normal there.
    """
    current = np.array(theta, dtype=float)
    lengths = np.array([side.length for side in surface.domain])
    for _ in range(_STEPS):
        error, first, second, gradient, hessian = _newton_terms(surface, points, current)
        step = np.linalg.solve(hessian, gradient[..., None])[..., 0]
        new = current + step
        for k, side in enumerate(surface.domain):
            if not surface.closed[k]:
                new[:, k] = np.clip(new[:, k], side.begin, side.end)
        moved = np.abs(new - current).max(axis=0)
        current = new
        if np.all(moved <= _CONVERGED * lengths):
            break
    error, first, second, _, _ = _newton_terms(surface, points, current)
    normals = np.cross(first, second)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Residuals(surface.wrap(current), np.sum(error * normals, axis=1))


def check_scatter(
    left: Residuals, points: np.ndarray, spacing: float, tolerance: float | None
) -> None:
    """Refuse points of two sheets, and without a tolerance those far away from all others.

    Args:
        left: Residuals of the points.
        points: [n, 3], m.
        spacing: Spacing of the points, m.
        tolerance: The user's tolerance [m], or None.
    """
    distances = np.abs(left.distances)
    if left.rms > _STRAY_SPACINGS * spacing and distances.mean() > _TWO_SHEETS * left.rms:
        raise InputError(
            f"surface points: lie {distances.mean():.3g} m to either side of the surface fitted,"
            " none on it; points of a single sheet are required"
        )
    usual = float(np.median(distances)) / _MEDIAN_OF_NORMAL
    worst = int(np.argmax(distances))
    stray = distances[worst] > max(_STRAY * usual, _STRAY_SPACINGS * spacing)
    if tolerance is None and stray:
        raise InputError(
            f"surface points: number {worst + 1} of those fitted,"
            f" [{', '.join(f'{value:.6g}' for value in points[worst])}] m, is"
            f" {distances[worst]:.3g} m away from the surface, the others {usual:.3g} m: take it"
            " out, or give a tolerance"
        )


def _newton_terms(
    surface: Surface, points: np.ndarray, theta: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return y - sigma, both tangents, half the slope of its square and the Gauss-Newton matrix."""
    rows = surface.partials(theta, 1)
    error = points - rows[:, 0]
    tangents = rows[:, [partial_index(1, 0), partial_index(0, 1)]]
    gradient = np.einsum("nki,ni->nk", tangents, error)
    metric = np.einsum("nki,nli->nkl", tangents, tangents)
    return error, tangents[:, 0], tangents[:, 1], gradient, metric


# Part of the tolerance up to which points are inside.
_INSIDE = 0.995
# Largest share of points that may be pulled: more are noise, not stray points.
_FEW = 0.05


def smoothest_within(
    spline: PenalizedSpline,
    exponent: float,
    tolerance: float,
    distances: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray:
    """Return the smoothest penalized spline that misses no point by more than a tolerance.

    The penalty is the strongest that leaves all distances within it, but not weaker than the one
    that suits the noise: a closer fit would follow the noise. Points that are still outside then
    get larger weights, if they are few.

    Args:
        spline: The spline to fit; its weights may be changed.
        exponent: Decimal logarithm of the roughness that suits the noise, see
            `PenalizedSpline.best_predicting`.
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
    if np.mean(distances(coefficients) > tolerance) <= _FEW:
        coefficients, is_near = spline.pull_in(exponent, tolerance, _INSIDE, distances)
        if is_near:
            return coefficients
    missed = distances(coefficients)
    worst = int(np.argmax(missed))
    digits = 1 - math.floor(math.log10(attainable))
    enough = math.ceil(1.05 * attainable * 10.0**digits) / 10.0**digits
    raise InputError(
        f"tolerance: {tolerance:g} m: the points scatter more about every smooth surface, which"
        f" misses number {worst + 1} of those fitted by {missed[worst]:.3g} m: allow {enough:g} m,"
        " or take that point out"
    )
