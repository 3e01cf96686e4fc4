"""Penalized tensor-product B-splines: least squares with a penalty on rough coefficients."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.sparse import csr_array, diags_array, eye_array, kron, vstack
from scipy.sparse.linalg import splu

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.surfaces.spline_surface import UniformKnots
from pfsc_drake.geometry.surfaces.surface import Surface, partial_index

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
    """Where points stand relative to a surface.

    Attributes:
        theta: Parameters of the nearest points of the surface, [n, 2].
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
    """Distances of points from a surface.

    Args:
        surface: The surface.
        points: [n, 3], m, near it.
        theta: Guesses of their parameters, [n, 2].

    Returns:
        The residuals; of points beyond an end their distances along the normal there.
    """
    place = np.array(theta, dtype=float)
    lengths = np.array([side.length for side in surface.domain])
    for _ in range(_STEPS):
        error, first, second, gradient, hessian = _foot(surface, points, place)
        step = np.linalg.solve(hessian, gradient[..., None])[..., 0]
        new = place + step
        for k, side in enumerate(surface.domain):
            if not surface.closed[k]:
                new[:, k] = np.clip(new[:, k], side.begin, side.end)
        moved = np.abs(new - place).max(axis=0)
        place = new
        if np.all(moved <= _CONVERGED * lengths):
            break
    error, first, second, _, _ = _foot(surface, points, place)
    normals = np.cross(first, second)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Residuals(surface.wrap(place), np.sum(error * normals, axis=1))


def check_scatter(
    left: Residuals, points: np.ndarray, spacing: float, tolerance: float | None
) -> None:
    """Refuse points of two sheets, and without a tolerance those far away from all others.

    Args:
        left: Residuals of the points.
        points: [n, 3], m.
        spacing: Distance at which they stand, m.
        tolerance: Whether the user has said how far points may be away.
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


def _foot(
    surface: Surface, points: np.ndarray, theta: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Error y - sigma, both tangents, half the slope of its square and the Hessian's main part."""
    rows = surface.partials(theta, 1)
    error = points - rows[:, 0]
    tangents = rows[:, [partial_index(1, 0), partial_index(0, 1)]]
    gradient = np.einsum("nki,ni->nk", tangents, error)
    metric = np.einsum("nki,nli->nkl", tangents, tangents)
    return error, tangents[:, 0], tangents[:, 1], gradient, metric


_REFINEMENTS = 2
# Random vectors from which traces are estimated.
_PROBES = 16
# Logarithms of the roughness: beyond them only the knots decide, or rounding errors do.
_LEAST, _MOST, _STEP = -8.0, 10.0, 0.2
_NEAR = 1.0


class PenalizedSurface:
    """Splines of two parameters that give and take between closeness and smoothness.

    The coefficients c minimize, after P. H. C. Eilers and B. D. Marx, "Flexible smoothing with
    B-splines and penalties", Statistical Science 11 (1996),

        sum_i w_i |sum_j B_j(theta_i) c_j - z_i|^2
            + roughness (n / cells) sum_a binom(m, a) sum |D_1^a D_2^(m-a) c|^2

    with differences D of neighbouring coefficients, relative to the mean of both knot steps: a
    discrete form of the energy of a thin plate, int sum_a binom(m, a) (d^m f / d theta_1^a d
    theta_2^(m-a))^2, of order m = degree // 2 + 1. It does not depend on how the axes are turned.

    Args:
        theta: theta_i, [n, 2], within the knots' domains.
        values: z_i, [n] or [n, dimension].
        first: Knots of theta_1.
        second: Knots of theta_2.
    """

    def __init__(
        self,
        theta: np.ndarray,
        values: np.ndarray,
        first: UniformKnots,
        second: UniformKnots,
    ) -> None:
        self.first, self.second = first, second
        self._values = values
        self._basis = _products(first, second, theta)
        self._differences = _differences(first, second) * math.sqrt(
            len(values) / (first.intervals * second.intervals)
        )
        self._penalty = self._differences.T @ self._differences
        self.weigh(np.ones(len(values)))

    def weigh(self, weights: np.ndarray) -> None:
        """Give each value a weight w_i, [n], positive; they are one at first."""
        self.weights = weights
        weighted = csr_array(diags_array(weights) @ self._basis).T
        self._closeness = weighted @ self._basis
        self._right = weighted @ self._values

    def fit(self, exponent: float) -> np.ndarray:
        """Coefficients of the best spline, [first.count * second.count(, dimension)].

        Args:
            exponent: Decimal logarithm of the roughness.
        """
        return self._fit(self._solver(exponent), exponent)

    def residuals(self, coefficients: np.ndarray) -> np.ndarray:
        """Spline less values, shape as these."""
        return np.asarray(self._basis @ coefficients - self._values)

    def best_predicting(self, around: float | None = None) -> tuple[float, float]:
        """Roughness whose spline predicts left-out points best, and the noise it leaves.

        The score is that of generalized cross-validation, n |w^(1/2) r|^2 / (n - p)^2 with
        residuals r and p the trace of the map from values to the spline's (P. Craven and G.
        Wahba, Numerische Mathematik 31, 1979), p estimated from random signs (M. F. Hutchinson).

        Args:
            around: Decimal logarithm of a roughness that is known to be near.

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

    def strongest(self, allowed: Callable[[np.ndarray], bool], least: float) -> float:
        """The strongest penalty whose spline is allowed, but not less than ``least``.

        Args:
            allowed: Told coefficients.
            least: Decimal logarithm of a roughness.

        Returns:
            Decimal logarithm of the roughness.
        """
        low, high = least, max(least, _MOST)
        if allowed(self.fit(high)):
            return high
        while high - low > _STEP:
            middle = (low + high) / 2.0
            low, high = (middle, high) if allowed(self.fit(middle)) else (low, middle)
        return low

    def standard_errors(self, theta: np.ndarray, exponent: float) -> np.ndarray:
        """How uncertain the spline is, over the noise of values of weight one.

        Args:
            theta: Parameters, [n, 2].
            exponent: Decimal logarithm of the roughness, as found by `best_predicting`.

        Returns:
            sqrt(b' (B' W B + roughness penalty)^-1 b) with the B-splines b there, [n]; for a
            penalty that suits the values it holds both their noise and what they leave open.
        """
        places = _products(self.first, self.second, theta)
        columns = places.toarray().T
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


def _products(first: UniformKnots, second: UniformKnots, theta: np.ndarray) -> csr_array:
    """All products of B-splines of both directions at parameters, [n, coefficients]."""
    columns_1, entries_1 = first.entries(theta[:, 0])
    columns_2, entries_2 = second.entries(theta[:, 1])
    data = entries_1[:, :, None] * entries_2[:, None, :]
    place = columns_1[:, :, None] * second.count + columns_2[:, None, :]
    rows = np.repeat(np.arange(len(theta)), data[0].size)
    shape = (len(theta), first.count * second.count)
    return csr_array((data.ravel(), (rows, place.ravel())), shape=shape)


def _differences(first: UniformKnots, second: UniformKnots) -> csr_array:
    """All differences of order m of neighbouring coefficients, weighted and stacked."""
    order = first.degree // 2 + 1
    ratio = math.sqrt(second.step / first.step)
    along = [_powers(first, order), _powers(second, order)]
    parts = [
        kron(along[0][a], along[1][order - a])
        * (math.sqrt(math.comb(order, a)) * ratio ** (2 * a - order))
        for a in range(order + 1)
    ]
    return csr_array(vstack(parts))


def _powers(knots: UniformKnots, order: int) -> list[csr_array]:
    """Differences of order 0..order of the coefficients in one direction."""
    found = [csr_array(eye_array(knots.count, format="csr"))]
    for _ in range(order):
        last = found[-1]
        rows = last.shape[0]
        following = csr_array(last[np.arange(1, rows + knots.closed) % rows])
        found.append(csr_array(following - last[: following.shape[0]]))
    return found
