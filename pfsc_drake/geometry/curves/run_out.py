"""Smooth continuation of a curve beyond its end to a straight line."""

import math

import casadi as ca
import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike

from pfsc_drake.geometry.curves.curve import Curve, check_order

# Largest change of the tangent by a term of the Taylor series, relative to it.
_BEND = 0.5


class RunOut(Curve):
    """Curve that continues another one smoothly from its end to a constant derivative.

    With the distance u from the end, outwards, and its length L::

        sigma'(u) = (1 - w(u / L)) T(u) + w(u / L) g

    T is the Taylor polynomial of the curve's derivative at the end, w rises from 0 to 1 with
    k - 1 vanishing derivatives at both ends, so that the curve is of class C^k there and can be
    continued with the constant derivative g in class C^k.

    Args:
        derivatives: Derivatives of the curve at its end by theta, orders 0..k, [k + 1, dimension].
        final: The derivative g by theta, [dimension].
        theta: Parameter of the end.
        length: L, positive if theta grows outwards, else negative.
    """

    def __init__(
        self, derivatives: np.ndarray, final: np.ndarray, theta: float, length: float
    ) -> None:
        breakpoints = sorted((theta, theta + length))
        super().__init__(derivatives.shape[1], breakpoints, closed=False, smoothness=math.inf)
        k = len(derivatives) - 1
        self._theta, self._length = theta, length
        rise = _smooth_step(k)
        components = []
        for column, slope in zip(derivatives.T, final, strict=True):
            # in x = u / L, of which theta is a linear function
            taylor = [column[j] * length**j / math.factorial(j - 1) for j in range(1, k + 1)]
            rate = (1.0 - rise) * Polynomial(taylor) + rise * (slope * length)
            components.append(rate.integ() + column[0])
        self._degree = max(p.degree() for p in components)
        self._coefficients = np.zeros((self.dimension, self._degree + 1))
        for row, polynomial in zip(self._coefficients, components, strict=True):
            row[: polynomial.degree() + 1] = polynomial.coef

    def derivatives(self, theta: ArrayLike, order: int) -> np.ndarray:
        """Return derivatives 0..order with respect to theta, for set-up and figures."""
        x = (self._to_domain(theta) - self._theta) / self._length
        powers = x[..., None] ** np.arange(self._degree + 1)
        return np.einsum("kdj,...j->...kd", self._table(order), powers)

    def expression(self, theta: ca.SX, order: int) -> ca.SX:
        """Return `derivatives` at a scalar as an expression, [order + 1, dimension]."""
        x = (theta - self._theta) / self._length
        powers = [ca.SX(1.0)]
        for _ in range(self._degree):
            powers.append(powers[-1] * x)
        rows = [ca.sparsify(ca.DM(rows)) @ ca.vertcat(*powers) for rows in self._table(order)]
        return ca.horzcat(*rows).T

    def _table(self, order: int) -> np.ndarray:
        """Return a map from powers of x to derivatives, [order + 1, dimension, degree + 1]."""
        table = np.zeros((check_order(order) + 1, *self._coefficients.shape))
        for k in range(min(order, self._degree) + 1):
            for j in range(k, self._degree + 1):
                factor = math.perm(j, k) / self._length**k
                table[k, :, j - k] = factor * self._coefficients[:, j]
        return table


def straightening_length(derivatives: np.ndarray, longest: float) -> float:
    """Return a length in which no term of the Taylor series leads far from the tangent.

    Args:
        derivatives: Derivatives of the curve at its end by theta, orders 0..k, [k + 1, dimension].
        longest: Largest length by theta.
    """
    lengths, speed = [longest], float(np.linalg.norm(derivatives[1]))
    for j in range(2, len(derivatives)):
        size = float(np.linalg.norm(derivatives[j]))
        if size > 0.0:
            lengths.append((_BEND * speed * math.factorial(j - 1) / size) ** (1.0 / (j - 1)))
    return min(lengths)


def _smooth_step(k: int) -> Polynomial:
    """Return the polynomial from 0 at 0 to 1 at 1 with k - 1 vanishing derivatives at both."""
    x = Polynomial([0.0, 1.0])
    slope = (x * (1.0 - x)) ** (k - 1)
    rise = slope.integ()
    return rise / rise(1.0)
