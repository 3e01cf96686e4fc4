"""The smoothest spline within a tolerance of noisy points."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from pfsc_drake.geometry.curves.penalized_spline import PenalizedSpline
from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve
from pfsc_drake.geometry.curves.spline import UniformKnots

Deviation = Callable[[np.ndarray], np.ndarray]

# Logarithm of the roughness below which only the knots decide, and how exactly one is found.
_LEAST, _STEP = -6.0, 0.05
_FEWEST_INTERVALS, _MOST_INTERVALS = 8, 20_000
# Part of the tolerance that the knots alone may use.
_KNOT_SHARE = 0.1
# Part of the tolerance up to which points are inside.
_INSIDE = 0.999


class SmoothFit(NamedTuple):
    """A spline near points.

    Attributes:
        curve: The spline on [0, end].
        deviations: Distance of each point from it, [n].
        attainable: Largest deviation of a curve that follows no noise; the tolerance to
            request where `deviations` exceed the present one.
    """

    curve: PiecewisePolynomialCurve
    deviations: np.ndarray
    attainable: float


def smoothest_within(
    parameters: np.ndarray,
    points: np.ndarray,
    end: float,
    *,
    degree: int,
    closed: bool,
    tolerance: float,
    noise: float,
    deviation: Deviation,
) -> SmoothFit:
    """Return the smoothest penalized spline near points, at most `tolerance` away from each.

    There are twice as many knots as least squares need to come as near as the noise permits.
    The penalty is the strongest that either puts all points within the tolerance, or leaves
    deviations as large as the noise (V. A. Morozov's principle of discrepancy): a closer fit
    would follow the noise. Points that are still outside then get larger weights.

    Args:
        parameters: Parameters of the points, [n], within [0, end].
        points: [n, dimension].
        end: End of the domain.
        degree: Degree of the polynomials; the spline is of class C^(degree - 1).
        closed: True for a periodic spline.
        tolerance: Largest deviation allowed.
        noise: Root mean square of the deviations by noise, see `noise_level`.
        deviation: Maps values at all parameters [n, dimension] to deviations [n].

    Returns:
        The spline; some deviations exceed the tolerance where even as many knots as points do
        not suffice.
    """
    most = max(min(len(points), _MOST_INTERVALS), _FEWEST_INTERVALS)
    allowed = noise + _KNOT_SHARE * tolerance

    centre = points.mean(axis=0)

    def on(intervals: int) -> PenalizedSpline:
        knots = UniformKnots(0.0, end, intervals, degree, closed)
        return PenalizedSpline(parameters[:, None], points - centre, knots)

    def distances_of(coefficients: np.ndarray) -> np.ndarray:
        return deviation(spline.at_points(coefficients + centre))

    def near(coefficients: np.ndarray) -> bool:
        found = distances_of(coefficients)
        return bool(found.max() <= _INSIDE * tolerance or _rms(found) <= noise)

    intervals = _FEWEST_INTERVALS
    while intervals < most:
        spline = on(intervals)
        if _rms(distances_of(spline.fit(_LEAST))) <= allowed:
            break
        intervals *= 2
    attainable = None
    while True:
        intervals = min(2 * intervals, most)
        spline = on(intervals)
        roughness = spline.strongest(near, _LEAST, _STEP)
        coefficients = spline.fit(roughness)
        attainable = attainable or float(distances_of(coefficients).max())
        if attainable > tolerance:
            coefficients, _ = spline.pull_in(roughness, tolerance, _INSIDE, distances_of)
        deviations = distances_of(coefficients)
        if deviations.max() <= tolerance or intervals == most:
            curve = spline.knots[0].curve(coefficients + centre)
            return SmoothFit(curve, deviations, attainable)


def noise_level(parameters: np.ndarray, points: np.ndarray, *, across: bool) -> float:
    """Return the root mean square noise of points, from their prediction by neighbours.

    Each point is compared with the cubic polynomial through two neighbours on either side.
    Where points are sparse, the error of the cubic on a smooth curve counts as noise, too.

    Args:
        parameters: [n], not decreasing.
        points: [n, dimension].
        across: True to ignore the part along the curve.

    Returns:
        The noise; zero of less than five points.
    """
    if len(points) < 5:
        return 0.0
    offsets = [-2, -1, 1, 2]
    inner = np.arange(2, len(points) - 2)
    sites = np.stack([parameters[inner + k] - parameters[inner] for k in offsets], axis=1)
    weights = np.ones_like(sites)
    for j in range(4):
        for k in range(4):
            if j != k:
                gap = sites[:, k] - sites[:, j]
                weights[:, j] *= np.where(gap == 0.0, 1.0, sites[:, k] / np.where(gap, gap, 1.0))
    error = points[inner] - sum(
        weights[:, [j]] * points[inner + k] for j, k in enumerate(offsets)
    )  # fmt: skip
    error = error / np.sqrt(1.0 + np.sum(weights**2, axis=1, keepdims=True))
    if across:
        along = points[inner + 2] - points[inner - 2]
        square = np.sum(along**2, axis=1, keepdims=True)
        share = np.sum(error * along, axis=1, keepdims=True) / np.where(square, square, 1.0)
        error = error - share * along
    return _rms(np.linalg.norm(error, axis=1))


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
