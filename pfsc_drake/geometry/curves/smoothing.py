"""The smoothest spline within a tolerance of noisy points."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline
from scipy.sparse import csr_array, diags_array, eye_array
from scipy.sparse.linalg import splu

from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve
from pfsc_drake.geometry.curves.spline import fold_columns, piecewise

_REFINEMENTS = 2


class PenalizedSpline:
    """Splines that give and take between closeness to points and smoothness.

    P-splines after P. H. C. Eilers and B. D. Marx, "Flexible smoothing with B-splines and
    penalties", Statistical Science 11 (1996): the coefficients c minimize

        sum_i w_i |sum_j B_j(t_i) c_j - p_i|^2 + roughness (n / knots) sum_j |D^m c_j|^2

    with B-splines B_j on uniform knots and differences D^m of order m of neighbouring
    coefficients, a discrete form of the m-th derivative. Its order, m = degree // 2 + 1,
    makes the noise of all continuous derivatives decay as the roughness allowed goes down.

    Args:
        parameters: t_i, [n], within the domain.
        points: p_i, [n, dimension].
        end: End of the domain [0, end].
        intervals: Number of knot intervals.
        degree: Degree of the polynomials.
        closed: True for a periodic spline.
    """

    def __init__(
        self,
        parameters: np.ndarray,
        points: np.ndarray,
        end: float,
        intervals: int,
        degree: int,
        *,
        closed: bool,
    ) -> None:
        self.degree, self.intervals, self.closed, self._end = degree, intervals, closed, end
        self._points, self._centre = points, points.mean(axis=0)
        self._knots = end / intervals * np.arange(-degree, intervals + degree + 1)
        # Knots are multiples of a step: the ends are not exactly on them.
        inside = np.clip(parameters, self._knots[degree], self._knots[-degree - 1])
        basis = BSpline.design_matrix(inside, self._knots, degree)
        count = intervals if closed else intervals + degree
        self._basis = fold_columns(basis, count) if closed else basis
        order = degree // 2 + 1
        differences = eye_array(count, format="csr")
        for _ in range(order):
            rows = differences.shape[0]
            following = csr_array(differences[np.arange(1, rows + closed) % rows])
            differences = following - differences[: following.shape[0]]
        self._differences = csr_array(differences) * math.sqrt(len(points) / intervals)
        self._closeness = self._basis.T @ self._basis
        self._right = self._basis.T @ (points - self._centre)
        self._penalty = self._differences.T @ self._differences

    def fit(self, roughness: float, weights: np.ndarray | None = None) -> np.ndarray:
        """Coefficients of the best spline.

        Args:
            roughness: What the penalty is multiplied with, positive.
            weights: w_i, [n], positive; by default all are one.

        Returns:
            [intervals, dimension] if closed, else [intervals + degree, dimension].
        """
        closeness, right = self._closeness, self._right
        if weights is not None:
            weighted = csr_array(diags_array(weights) @ self._basis).T
            closeness, right = weighted @ self._basis, weighted @ (self._points - self._centre)
        normal = closeness + roughness * self._penalty
        solve = splu(normal.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0).solve
        coefficients = solve(right)
        # A strong penalty makes the matrix ill-conditioned, but not the differences themselves.
        for _ in range(_REFINEMENTS):
            bent = self._differences.T @ (self._differences @ coefficients)
            coefficients = coefficients + solve(right - closeness @ coefficients - roughness * bent)
        return np.asarray(coefficients + self._centre)

    def at_points(self, coefficients: np.ndarray) -> np.ndarray:
        """Values of a spline at the parameters of the points, [n, dimension]."""
        return np.asarray(self._basis @ coefficients)

    def curve(self, coefficients: np.ndarray) -> PiecewisePolynomialCurve:
        """The spline as a curve on [0, end], of class C^(degree - 1)."""
        count = self.intervals + self.degree
        unfolded = coefficients[np.arange(count) % len(coefficients)]
        spline = BSpline(self._knots, unfolded, self.degree)
        starts = self._knots[self.degree : -self.degree - 1]
        return piecewise(spline, starts, self._end, closed=self.closed)


Deviation = Callable[[np.ndarray], np.ndarray]

# Logarithms of the roughness: beyond them only the knots decide, or rounding errors do.
_LEAST, _MOST, _STEP = -6.0, 10.0, 0.05
_FEWEST_INTERVALS, _MOST_INTERVALS = 8, 20_000
# What of the tolerance the knots alone may cost.
_KNOT_SHARE = 0.1
# Points out of the tolerance pull harder until they are in.
_PULLS, _LEAST_PULL, _STRONGEST = 60, 1.5, 1e9
_INSIDE = 0.999


class SmoothFit(NamedTuple):
    """A spline near points.

    Attributes:
        curve: The spline on [0, end].
        deviations: Distance of each point from it, [n].
        attainable: Largest deviation of a curve that follows no noise; the tolerance to ask
            for where `deviations` exceed the one given.
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
    """The smoothest penalized spline near points, at most `tolerance` away from each.

    The knots are twice as many as least squares need to come as near as the noise lets them.
    The penalty is the strongest that either keeps all points within the tolerance, or leaves
    deviations as large as the noise (V. A. Morozov's principle of discrepancy): fitting more
    closely would follow the noise. Points that are still outside then get larger weights.

    Args:
        parameters: Parameters of the points, [n], within [0, end].
        points: [n, dimension].
        end: End of the domain.
        degree: Degree of the polynomials; the spline is of class C^(degree - 1).
        closed: True for a periodic spline.
        tolerance: Largest deviation allowed.
        noise: Root mean square of the deviations that noise makes, see `noise_level`.
        deviation: Maps values at all parameters [n, dimension] to deviations [n].

    Returns:
        The spline; some deviations exceed the tolerance where even as many knots as points
        do not let it come near enough.
    """
    most = max(min(len(points), _MOST_INTERVALS), _FEWEST_INTERVALS)
    allowed = noise + _KNOT_SHARE * tolerance

    def on(intervals: int) -> PenalizedSpline:
        return PenalizedSpline(parameters, points, end, intervals, degree, closed=closed)

    intervals = _FEWEST_INTERVALS
    while intervals < most:
        spline = on(intervals)
        values = spline.at_points(spline.fit(10.0**_LEAST))
        if _rms(deviation(values)) <= allowed:
            break
        intervals *= 2
    attainable = None
    while True:
        intervals = min(2 * intervals, most)
        spline = on(intervals)
        roughness = _roughness(spline, tolerance, noise, deviation)
        coefficients = spline.fit(roughness)
        deviations = deviation(spline.at_points(coefficients))
        attainable = attainable or float(deviations.max())
        if attainable > tolerance:
            coefficients = _pull_in(spline, roughness, tolerance, deviation)
            deviations = deviation(spline.at_points(coefficients))
        if deviations.max() <= tolerance or intervals == most:
            return SmoothFit(spline.curve(coefficients), deviations, attainable)


def noise_level(parameters: np.ndarray, points: np.ndarray, *, across: bool) -> float:
    """Root mean square of the noise of points, from how badly neighbours predict each other.

    Each point is compared with the cubic polynomial through two neighbours on either side.
    What the cubic misses of a smooth curve counts as noise too, where points are sparse.

    Args:
        parameters: [n], not decreasing.
        points: [n, dimension].
        across: True to leave out what lies along the curve.

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


def _roughness(
    spline: PenalizedSpline, tolerance: float, noise: float, deviation: Deviation
) -> float:
    """The strongest penalty that the tolerance or the noise allows."""

    def near(exponent: float) -> bool:
        found = deviation(spline.at_points(spline.fit(10.0**exponent)))
        return bool(found.max() <= _INSIDE * tolerance or _rms(found) <= noise)

    low, high = _LEAST, _MOST
    if near(high):
        return 10.0**high
    while high - low > _STEP:
        middle = (low + high) / 2.0
        low, high = (middle, high) if near(middle) else (low, middle)
    return float(10.0**low)


def _pull_in(
    spline: PenalizedSpline, roughness: float, tolerance: float, deviation: Deviation
) -> np.ndarray:
    """Coefficients with larger weights of those points that would lie outside."""
    coefficients = spline.fit(roughness)
    deviations = deviation(spline.at_points(coefficients))
    weights = np.ones(len(deviations))
    for _ in range(_PULLS):
        outside = deviations > _INSIDE * tolerance
        if not np.any(outside):
            break
        pull = np.maximum(_LEAST_PULL, (deviations[outside] / tolerance) ** 2)
        weights[outside] = np.minimum(weights[outside] * pull, _STRONGEST)
        coefficients = spline.fit(roughness, weights)
        deviations = deviation(spline.at_points(coefficients))
    return coefficients


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
