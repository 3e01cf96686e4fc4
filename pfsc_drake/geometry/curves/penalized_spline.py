"""Penalized B-splines: least squares with a penalty on rough coefficients."""

import math
from collections.abc import Callable

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.sparse import csr_array, diags_array, eye_array, kron, vstack
from scipy.sparse.linalg import splu

from pfsc_drake.geometry.curves.spline import UniformKnots

_REFINEMENTS = 2
# Random vectors from which traces are estimated.
_PROBES = 16
# Logarithms of the roughness: beyond them only the knots decide, or rounding errors do.
_LEAST, _MOST, _STEP = -8.0, 10.0, 0.2
_NEAR = 1.0
# Points out of the tolerance pull harder until they are in.
_PULLS, _LEAST_PULL, _STRONGEST = 60, 1.5, 1e9


class PenalizedSpline:
    """Splines of one or two parameters that give and take between closeness and smoothness.

    The coefficients c minimize, after P. H. C. Eilers and B. D. Marx, "Flexible smoothing with
    B-splines and penalties", Statistical Science 11 (1996),

        sum_i w_i |sum_j B_j(theta_i) c_j - z_i|^2
            + roughness (n / cells) sum_a binom(m, a) sum |D_1^a D_2^(m-a) c|^2

    with differences D of neighbouring coefficients, relative to the mean of both knot steps: a
    discrete form of the energy of a thin plate, int sum_a binom(m, a) (d^m f / d theta_1^a d
    theta_2^(m-a))^2, of order m = degree // 2 + 1. It does not depend on how the axes are turned.
    Of one parameter the penalty is ``sum |D^m c|^2``. The order makes the noise of all continuous
    derivatives decay as the roughness allowed goes down.

    Args:
        theta: theta_i, [n, parameters], within the knots' domains.
        values: z_i, [n] or [n, dimension].
        *knots: Knots of each parameter, of one degree.

    Attributes:
        knots: Knots of each parameter.
        weights: w_i, [n].
    """

    def __init__(self, theta: np.ndarray, values: np.ndarray, *knots: UniformKnots) -> None:
        self.knots, self._values = knots, values
        self._basis = _products(knots, theta)
        cells = math.prod(side.intervals for side in knots)
        self._differences = _differences(knots) * math.sqrt(len(values) / cells)
        self._penalty = self._differences.T @ self._differences
        self.weigh(np.ones(len(values)))

    def weigh(self, weights: np.ndarray) -> None:
        """Give each value a weight w_i, [n], positive; they are one at first."""
        self.weights = weights
        weighted = csr_array(diags_array(weights) @ self._basis).T
        self._closeness = weighted @ self._basis
        self._right = weighted @ self._values

    def fit(self, exponent: float) -> np.ndarray:
        """Return coefficients of the best spline, [product of the knots' counts(, dimension)].

        Args:
            exponent: Decimal logarithm of the roughness.
        """
        return self._fit(self._solver(exponent), exponent)

    def at_points(self, coefficients: np.ndarray) -> np.ndarray:
        """Return values of a spline at theta_i, [n(, dimension)]."""
        return np.asarray(self._basis @ coefficients)

    def residuals(self, coefficients: np.ndarray) -> np.ndarray:
        """Return spline minus values, shape as these."""
        return np.asarray(self._basis @ coefficients - self._values)

    def best_predicting(self, around: float | None = None) -> tuple[float, float]:
        """Return the roughness that predicts left-out points best, and the remaining noise.

        The score is the one of generalized cross-validation, n |w^(1/2) r|^2 / (n - p)^2 with
        residuals r and p the trace of the map from values to the spline's (P. Craven and G.
        Wahba, Numerische Mathematik 31, 1979), p estimated from random signs (M. F. Hutchinson).

        Args:
            around: Decimal logarithm of a nearby roughness, if known.

        Returns:
            Decimal logarithm of the roughness, and sqrt(|w^(1/2) r|^2 / (n - p)).
        """
        signs = np.random.default_rng(0).choice([-1.0, 1.0], (len(self._values), _PROBES))
        probes = self._basis.T @ (np.sqrt(self.weights)[:, None] * signs)

        def judge(exponent: float) -> tuple[float, float]:
            solve = self._solver(exponent)
            parameters = float(np.sum(probes * solve(probes))) / _PROBES
            free = max(len(self._values) - parameters, 1e-3 * len(self._values))
            residuals = self.residuals(self._fit(solve, exponent))
            square = float(self.weights @ np.sum(residuals.reshape(len(signs), -1) ** 2, axis=1))
            return square / free**2, math.sqrt(square / free)

        low, high = (_LEAST, _MOST) if around is None else (around - _NEAR, around + _NEAR)
        found = minimize_scalar(
            lambda exponent: math.log(judge(exponent)[0] + np.finfo(float).tiny),
            bounds=(max(low, _LEAST), min(high, _MOST)),
            method="bounded",
            options={"xatol": _STEP},
        )
        return float(found.x), judge(found.x)[1]

    def strongest(
        self, allowed: Callable[[np.ndarray], bool], least: float, step: float = _STEP
    ) -> float:
        """Return the strongest penalty whose spline is allowed, but not less than ``least``.

        Args:
            allowed: Predicate of the coefficients.
            least: Decimal logarithm of a roughness.
            step: Resolution of the search.

        Returns:
            Decimal logarithm of the roughness.
        """
        low, high = least, max(least, _MOST)
        if allowed(self.fit(high)):
            return high
        while high - low > step:
            middle = (low + high) / 2.0
            low, high = (middle, high) if allowed(self.fit(middle)) else (low, middle)
        return low

    def pull_in(
        self,
        exponent: float,
        tolerance: float,
        inside: float,
        distances: Callable[[np.ndarray], np.ndarray],
    ) -> tuple[np.ndarray, bool]:
        """Increase the weights of points that would lie outside of a tolerance.

        Args:
            exponent: Decimal logarithm of the roughness.
            tolerance: Largest distance allowed.
            inside: Part of it up to which points are inside.
            distances: Maps coefficients to the distances of all points, [n].

        Returns:
            Coefficients, and whether all points are known to be inside.
        """
        weights, coefficients = self.weights.copy(), self.fit(exponent)
        for _ in range(_PULLS):
            missed = distances(coefficients)
            outside = missed > inside * tolerance
            if not np.any(outside):
                return coefficients, True
            pull = np.maximum(_LEAST_PULL, (missed[outside] / tolerance) ** 2)
            weights[outside] = np.minimum(weights[outside] * pull, _STRONGEST)
            self.weigh(weights)
            coefficients = self.fit(exponent)
        return coefficients, False

    def standard_errors(self, theta: np.ndarray, exponent: float) -> np.ndarray:
        """Return the standard error of the spline, relative to the noise of values of weight one.

        Args:
            theta: Parameters, [n, parameters].
            exponent: Decimal logarithm of the roughness, as found by `best_predicting`.

        Returns:
            sqrt(b' (B' W B + roughness penalty)^-1 b) with the B-splines b there, [n]; for a
            penalty that suits the values it includes their noise and the bias of smoothing.
        """
        products = _products(self.knots, theta)
        columns = products.toarray().T
        return np.asarray(np.sqrt(np.sum(columns * self._solver(exponent)(columns), axis=0)))

    def _solver(self, exponent: float) -> Callable[[np.ndarray], np.ndarray]:
        normal = self._closeness + 10.0**exponent * self._penalty
        return splu(normal.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0).solve

    def _fit(self, solve: Callable[[np.ndarray], np.ndarray], exponent: float) -> np.ndarray:
        coefficients = solve(self._right)
        # A strong penalty makes the matrix ill-conditioned, but not the differences themselves.
        for _ in range(_REFINEMENTS):
            bent = self._differences.T @ (self._differences @ coefficients)
            error = self._right - self._closeness @ coefficients - 10.0**exponent * bent
            coefficients = coefficients + solve(error)
        return coefficients


def _products(knots: tuple[UniformKnots, ...], theta: np.ndarray) -> csr_array:
    """Return all products of B-splines of all directions at parameters, [n, coefficients]."""
    indices, data = np.zeros((len(theta), 1), dtype=int), np.ones((len(theta), 1))
    for side, values in zip(knots, theta.T, strict=True):
        columns, entries = side.entries(values)
        data = (data[:, :, None] * entries[:, None, :]).reshape(len(theta), -1)
        indices = (indices[:, :, None] * side.count + columns[:, None, :]).reshape(len(theta), -1)
    rows = np.repeat(np.arange(len(theta)), data.shape[1])
    shape = (len(theta), math.prod(side.count for side in knots))
    return csr_array((data.ravel(), (rows, indices.ravel())), shape=shape)


def _differences(knots: tuple[UniformKnots, ...]) -> csr_array:
    """Return all differences of order m of neighbouring coefficients, weighted and stacked."""
    order = knots[0].degree // 2 + 1
    along = [_powers(side, order) for side in knots]
    if len(knots) == 1:
        return along[0][order]
    ratio = math.sqrt(knots[1].step / knots[0].step)
    parts = [
        kron(along[0][a], along[1][order - a])
        * (math.sqrt(math.comb(order, a)) * ratio ** (2 * a - order))
        for a in range(order + 1)
    ]
    return csr_array(vstack(parts))


def _powers(knots: UniformKnots, order: int) -> list[csr_array]:
    """Return differences of order 0..order of the coefficients in one direction."""
    found = [csr_array(eye_array(knots.count, format="csr"))]
    for _ in range(order):
        last = found[-1]
        rows = last.shape[0]
        following = csr_array(last[np.arange(1, rows + knots.closed) % rows])
        found.append(csr_array(following - last[: following.shape[0]]))
    return found
