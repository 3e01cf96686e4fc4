"""Speed scaling as a spline, as smooth as the control law needs."""

from functools import cached_property

import numpy as np
from scipy.interpolate import BSpline, make_lsq_spline

from pfsc_drake.control.planning.drive_demand import apply_scaling
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.geometry.curves.hermite import hermite_curve

# least coefficient, relative to the least fitted value
_LEAST = 0.5
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)


class ScalingSpline:
    """Speed scaling ``c = dtheta/dt`` of a motion over its motion time theta, from 0 to an end.

    Args:
        end: Final theta [s].
        coefficients: Coefficients of a clamped B-spline over even intervals; their number is that
            of the intervals plus the degree.
        degree: Degree d of the spline, at least 3; the scaling is C^(d-1).

    Attributes:
        end: Final theta [s].
    """

    def __init__(self, end: float, coefficients: np.ndarray, degree: int) -> None:
        self.end, self._intervals = end, len(coefficients) - degree
        knots = knots_of(end, self._intervals, degree)
        spline = BSpline(knots, coefficients, degree)
        self._derivatives = [spline] + [spline.derivative(k) for k in range(1, 4)]

    def rates(self, theta: np.ndarray) -> np.ndarray:
        """Return ``c`` and its time derivatives, shape (samples, 4) [1, 1/s, ..].

        Args:
            theta: Motion times [s], shape (samples,).
        """
        c, c_1, c_2, c_3 = (derivative(theta) for derivative in self._derivatives)
        return np.stack(time_derivatives(c, c_1, c_2, c_3), axis=1)

    @cached_property
    def _clock(self) -> tuple[np.ndarray, np.ndarray]:
        """Knots of theta and their times t [s]."""
        knots = np.linspace(0.0, self.end, self._intervals + 1)
        step = knots[1] / 2.0
        middles = knots[:-1] + step
        slowness = 1.0 / self._derivatives[0](middles[:, None] + step * _NODES)
        return knots, np.concatenate([[0.0], np.cumsum(step * slowness @ _WEIGHTS)])

    @property
    def duration(self) -> float:
        """Duration of the scaled motion [s]."""
        return float(self._clock[1][-1])

    def times(self, theta: np.ndarray) -> np.ndarray:
        """Return the times t of motion times [s], shape (samples,).

        Args:
            theta: Motion times [s], shape (samples,).
        """
        knots, times = self._clock
        i = np.clip(np.searchsorted(knots, theta, side="right") - 1, 0, self._intervals - 1)
        half = (theta - knots[i]) / 2.0
        slowness = 1.0 / self._derivatives[0]((knots[i] + half)[:, None] + half[:, None] * _NODES)
        return times[i] + half * (slowness @ _WEIGHTS)

    @classmethod
    def fit(cls, end: float, values: np.ndarray, intervals: int, degree: int) -> "ScalingSpline":
        """Return the least-squares fit to values on an even grid from 0 to the end.

        Args:
            end: Final theta [s].
            values: Positive values, shape (samples,).
            intervals: Number of intervals of the spline, fewer than samples.
            degree: Degree of the spline.
        """
        grid = np.linspace(0.0, end, len(values))
        fitted = make_lsq_spline(grid, values, knots_of(end, intervals, degree), degree).c
        return cls(end, np.maximum(fitted, _LEAST * values.min()), degree)

    def apply_to(
        self, motion: PiecewisePolynomialCurve, order: int, longest: float
    ) -> PiecewisePolynomialCurve:
        """Return the motion over the time t, of class C^order.

        Args:
            motion: Motion over theta, of class C^order.
            order: Order of continuity, up to 4.
            longest: Largest duration of a polynomial piece [s].
        """
        knots, times = self._clock
        parts = np.ceil(np.diff(times) / longest).astype(int)
        pieces = [
            begin + step * np.arange(n) / n
            for begin, step, n in zip(knots[:-1], np.diff(knots), parts, strict=True)
        ]
        theta = np.append(np.concatenate(pieces), self.end)
        derivatives = apply_scaling(motion.derivatives(theta, order), self.rates(theta))
        return hermite_curve(self.times(theta), derivatives)


def knots_of(end: float, intervals: int, degree: int) -> np.ndarray:
    """Return the knots of a clamped spline over even intervals.

    Args:
        end: Upper end of the domain; the lower one is 0.
        intervals: Number of intervals.
        degree: Degree of the spline.
    """
    inner = np.linspace(0.0, end, intervals + 1)
    return np.concatenate([np.zeros(degree), inner, np.full(degree, end)])


def time_derivatives(c: np.ndarray, c_1: np.ndarray, c_2: np.ndarray, c_3: np.ndarray) -> list:
    """Return the scaling and its time derivatives from the derivatives by theta.

    ``d/dt = c d/dtheta``, for numbers or symbols.
    """
    return [
        c,
        c * c_1,
        c * (c_1**2 + c * c_2),
        c * (c_1**3 + 4.0 * c * c_1 * c_2 + c**2 * c_3),
    ]
