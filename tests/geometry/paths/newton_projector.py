"""Closest point on a curve by Newton's method on numbers, to compare with."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pfsc_drake.geometry.curves.curve import Curve

_MAX_ITERATIONS = 60
# All relative to the length of the domain.
_TOLERANCE = 1e-12
_STALLED = 1e-8
_COARSE = 1e-7
_MAX_STEP = 1.0 / 32.0


class Projection(NamedTuple):
    """Result of the orthogonal projection onto a curve, (3.6).

    Attributes:
        theta: Parameter of the closest point, unwrapped: it counts revolutions.
        alpha: (3.9); the point lies in the feasible neighbourhood if alpha < 1.
        at_end: True if the curve is open and the point lies beyond one of its ends; theta
            is then that end.
        iterations: Number of evaluations of the curve.
        converged: False if no strict minimum was found, also for input that is not finite.
    """

    theta: float
    alpha: float
    at_end: bool
    iterations: int
    converged: bool


class Projector:
    """Local minimum of J(theta) = |y - sigma(theta)|^2 near a guess, by Newton's method (3.72).

    The step is limited, halved while J grows, and goes down the gradient, scaled by 1/|J''|,
    where J'' = 2 |sigma'|^2 (1 - alpha) is not positive. Started from the last result it follows
    its branch of the curve through self-intersections.

    Args:
        curve: Curve of class C^2, any dimension.
    """

    def __init__(self, curve: Curve) -> None:
        self.curve = curve
        self._begin, self._end = curve.domain
        self._closed = curve.closed

    def project(self, point: Sequence[float], theta_guess: float) -> Projection:
        """Closest point near the guess.

        Args:
            point: y, [dimension], m.
            theta_guess: Unwrapped parameter to start from, as a rule the last result.

        Returns:
            The projection; `converged` is False and nothing is raised if the point or the
            guess is not finite.
        """
        begin, end, closed = self._begin, self._end, self._closed
        y = np.asarray(point, dtype=float)
        length = end - begin
        tolerance, coarse, limit = _TOLERANCE * length, _COARSE * length, _MAX_STEP * length
        theta = theta_guess
        if not -math.inf < theta < math.inf:
            return Projection(theta_guess, math.nan, False, 0, False)
        if not closed:
            theta = min(max(theta, begin), end)
        origin, step, least, alpha = theta, 0.0, math.inf, math.nan
        for iteration in range(1, _MAX_ITERATIONS + 1):
            sigma, first, second = self.curve.derivatives(theta, 2)
            error = y - sigma
            cost, slope, square, bend = (
                float(one @ other)
                for one, other in (
                    (error, error),
                    (error, first),
                    (first, first),
                    (error, second),
                )
            )
            if not cost < math.inf:
                return Projection(theta_guess, math.nan, False, iteration, False)
            if cost > least and (step > coarse or step < -coarse):
                step *= 0.5
                theta = origin + step
                continue
            curvature = square - bend
            alpha = bend / square
            step = slope / (abs(curvature) or square)
            if step > limit:
                step = limit
            elif step < -limit:
                step = -limit
            if -tolerance < step < tolerance:
                return Projection(theta + step, alpha, False, iteration, curvature > 0.0)
            origin, least = theta, cost
            theta += step
            if not closed and not begin <= theta <= end:
                theta = begin if theta < begin else end
                step = theta - origin
                if step == 0.0:
                    return Projection(theta, alpha, True, iteration, True)
        # Near alpha = 1 rounding errors of the slope can exceed the tolerance.
        stalled = abs(step) < _STALLED * length and alpha < 1.0
        return Projection(theta, alpha, False, _MAX_ITERATIONS, stalled)
