"""Parametrized curves: their common interface."""

import math
from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.errors import InputError


class Curve(ABC):
    """A parametrized curve sigma: [theta_0, theta_1] -> R^dimension (section 3.1).

    Every curve is linear in a scalar basis on each of its segments, so all
    derivatives at one parameter are one product of a stored matrix with the
    vector of basis functions.

    Attributes:
        dimension: Number of components of sigma.
        domain: (theta_0, theta_1), the first and the last parameter.
        closed: True if theta is periodic with the period theta_1 - theta_0;
            parameters outside the domain are then wrapped.
        smoothness: k of the class C^k, `math.inf` if all derivatives are continuous
            (across the seam too, if the curve is closed).
        breakpoints: Segment boundaries with both ends, shape [segments + 1]. The curve
            is analytic between two of them.
    """

    def __init__(
        self, dimension: int, breakpoints: ArrayLike, *, closed: bool, smoothness: float
    ) -> None:
        breaks = np.array(breakpoints, dtype=float)
        if breaks.ndim != 1 or breaks.size < 2:
            raise InputError(
                f"breakpoints: shape {breaks.shape}; a vector of two or more is required"
            )
        if not np.all(np.isfinite(breaks)):
            raise InputError(f"breakpoints: {breaks.tolist()}; finite values are required")
        steps = np.diff(breaks)
        if np.any(steps <= 0.0):
            bad = int(np.argmax(steps <= 0.0))
            raise InputError(
                f"breakpoints {bad} and {bad + 1}: {breaks[bad]:.9g} and {breaks[bad + 1]:.9g};"
                " they must strictly increase"
            )
        breaks.setflags(write=False)
        self.dimension = dimension
        self.breakpoints = breaks
        self.domain = (float(breaks[0]), float(breaks[-1]))
        self.closed = closed
        self.smoothness = smoothness

    @property
    def period(self) -> float:
        """Length of the domain, theta_1 - theta_0."""
        return self.domain[1] - self.domain[0]

    def wrap(self, theta: ArrayLike) -> np.ndarray:
        """Return parameters moved into the domain by whole periods; unchanged if open.

        Args:
            theta: Path parameters, any shape.

        Returns:
            Array of the same shape.
        """
        values = np.asarray(theta, dtype=float)
        if not self.closed:
            return values
        begin, end = self.domain
        inside = (values >= begin) & (values <= end)
        return np.where(inside, values, begin + np.mod(values - begin, end - begin))

    def revolutions(self, theta: ArrayLike) -> np.ndarray:
        """Return the whole periods by which parameters lie outside the domain; zero if open.

        Args:
            theta: Unwrapped path parameters, any shape.

        Returns:
            Array of the same shape, of whole numbers.
        """
        values = np.asarray(theta, dtype=float)
        begin, end = self.domain
        outside = (values < begin) | (values > end)
        return np.where(outside & self.closed, np.floor((values - begin) / (end - begin)), 0.0)

    def first_discontinuity(self, order: int) -> float | None:
        """Return the parameter at which a derivative of at most this order first jumps.

        Args:
            order: Highest order of derivative.

        Returns:
            theta, or None if all derivatives up to `order` are continuous.
        """
        return None

    @abstractmethod
    def derivatives(self, theta: ArrayLike, order: int) -> np.ndarray:
        """Return derivatives 0..order with respect to theta, for set-up and figures.

        Args:
            theta: Path parameters, shape [...]. Closed curves wrap.
            order: Highest order of derivative, at least 0.

        Returns:
            Array of shape [..., order + 1, dimension].

        Raises:
            InputError: theta lies outside the domain of an open curve.
        """

    def _to_domain(self, theta: ArrayLike) -> np.ndarray:
        """Return wrapped parameters; refuse those outside of an open curve."""
        values = self.wrap(theta)
        begin, end = self.domain
        # Parameters result from sums and projections, so the ends have rounding errors.
        slack = 1e-9 * (end - begin)
        outside = ~((values >= begin - slack) & (values <= end + slack))
        if np.any(outside):
            bad = float(values[outside].flat[0]) if values.ndim else float(values)
            raise InputError(f"theta: {bad:.9g}; the curve is defined on [{begin:.9g}, {end:.9g}]")
        return values


def check_order(order: int) -> int:
    """Return the order of derivative, if it is an integer of at least zero.

    Raises:
        InputError: it is not.
    """
    if isinstance(order, bool) or int(order) != order or order < 0 or not math.isfinite(order):
        raise InputError(f"order of derivative: {order}; an integer >= 0 is required")
    return int(order)
