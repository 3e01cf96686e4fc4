"""Penalized B-splines: least squares on uniform knots with a penalty on rough coefficients."""

import math

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
        degree: Of the polynomials.
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
