"""Parametrized surfaces: their common interface, and their placement in the world."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.rotation import check_rotation_matrix

# A law of order five reads one order more.
MAX_PARTIAL_ORDER = 6


def partial_count(order: int) -> int:
    """Return how many partial derivatives there are up to a total order."""
    return (order + 1) * (order + 2) // 2


def partial_index(i: int, j: int) -> int:
    """Return the row of the derivative i times by theta_1 and j times by theta_2."""
    return partial_count(i + j - 1) + j


def partial_orders(order: int) -> list[tuple[int, int]]:
    """Return ``(i, j)`` of all rows up to a total order: (0, 0), (1, 0), (0, 1), (2, 0), ..."""
    return [(n - j, j) for n in range(order + 1) for j in range(n + 1)]


Sampler = Callable[[float, float], np.ndarray]


class Interval(NamedTuple):
    """First and last value of a parameter."""

    begin: float
    end: float

    @property
    def length(self) -> float:
        """Distance from begin to end."""
        return self.end - self.begin


class Surface(ABC):
    """A parametrized surface sigma_t: [begin_1, end_1] x [begin_2, end_2] -> R^3 (section 4.1).

    Attributes:
        domain: First and last value of theta_1 and of theta_2.
        closed: For each direction whether sigma_t is periodic in it; parameters outside the
            domain are then wrapped.
        smoothness: k of the class C^k, `math.inf` if all derivatives are continuous (across
            seams too).
        breakpoints: For each direction the lines between which the surface is analytic, with
            both ends, each [cells + 1].

    Args:
        breakpoints: Lines between which it is analytic, finite and strictly increasing.
        closed: Whether it is periodic in either direction.
        smoothness: k of the class C^k.

    Raises:
        InputError: Breakpoints that do not increase, or are not finite.
    """

    def __init__(
        self,
        breakpoints: tuple[ArrayLike, ArrayLike],
        *,
        closed: tuple[bool, bool],
        smoothness: float,
    ) -> None:
        first, second = (
            _checked_breakpoints(values, name)
            for values, name in zip(breakpoints, ("theta_1", "theta_2"), strict=True)
        )
        self.breakpoints = (first, second)
        self.domain = (
            Interval(float(first[0]), float(first[-1])),
            Interval(float(second[0]), float(second[-1])),
        )
        self.closed = closed
        self.smoothness = smoothness

    @abstractmethod
    def partials(self, theta: ArrayLike, order: int) -> np.ndarray:
        """Return all partial derivatives up to a total order, for set-up and figures.

        Args:
            theta: Parameters, shape [..., 2]. Closed directions wrap.
            order: Highest total order, 0 to 6.

        Returns:
            Array of shape [..., partial_count(order), 3], m, rows as in `partials`.

        Raises:
            InputError: theta lies outside the domain in an open direction, or the order is
                out of range.
        """

    @abstractmethod
    def flat_sampler(self, order: int) -> Sampler:
        """Return a fast scalar form of `partials` with a flattened result.

        Args:
            order: Highest total order, 0 to 6.

        Returns:
            Function of two finite floats theta_1, theta_2 that returns a new array
            [3 partial_count(order)]. Closed directions wrap; beyond the ends of open ones the
            last cell is continued analytically.
        """

    def wrap(self, theta: ArrayLike) -> np.ndarray:
        """Return parameters moved into the domain by whole periods in closed directions.

        Args:
            theta: Parameters, shape [..., 2].

        Returns:
            Array of the same shape.
        """
        values = np.array(theta, dtype=float)
        for k, (begin, end) in enumerate(self.domain):
            own = values[..., k]
            if self.closed[k]:
                wrapped = begin + np.mod(own - begin, end - begin)
                values[..., k] = np.where((own >= begin) & (own <= end), own, wrapped)
        return values

    def to_domain(self, theta: ArrayLike) -> np.ndarray:
        """Return wrapped parameters, shape [..., 2].

        Raises:
            InputError: theta is not a pair, or lies outside the domain in an open direction.
        """
        values = np.asarray(theta, dtype=float)
        if values.shape[-1:] != (2,):
            raise InputError(f"theta: shape {values.shape}; [..., 2] is required")
        values = self.wrap(values)
        for k, (begin, end) in enumerate(self.domain):
            # Parameters result from sums and projections, so the ends have rounding errors.
            slack = 1e-9 * (end - begin)
            own = values[..., k]
            outside = ~((own >= begin - slack) & (own <= end + slack))
            if np.any(outside):
                raise InputError(
                    f"theta_{k + 1}: {float(own[outside].flat[0]):.9g};"
                    f" the surface is defined on [{begin:.9g}, {end:.9g}]"
                )
        return values

    def grid(self, cells: int, fewest: int) -> tuple[np.ndarray, np.ndarray]:
        """Return parameters of samples in both directions, between any two breakpoints alike.

        Args:
            cells: Number of samples in each cell.
            fewest: Least number of samples in each direction.

        Returns:
            theta_1 [n_1] and theta_2 [n_2], increasing, with both ends; without the last in
            closed directions.
        """
        first, second = (
            _spread(breaks, max(cells, -(-fewest // (len(breaks) - 1))), closed)
            for breaks, closed in zip(self.breakpoints, self.closed, strict=True)
        )
        return first, second


def check_partial_order(order: int) -> int:
    """Return the total order of derivatives, if it is an integer from 0 to 6.

    Raises:
        InputError: it is not.
    """
    if not isinstance(order, int) or not 0 <= order <= MAX_PARTIAL_ORDER:
        raise InputError(
            f"order of partial derivatives: {order};"
            f" an integer from 0 to {MAX_PARTIAL_ORDER} is required"
        )
    return order


def _checked_breakpoints(values: ArrayLike, name: str) -> np.ndarray:
    breaks = np.array(values, dtype=float)
    increasing = breaks.ndim == 1 and len(breaks) > 1 and np.all(np.diff(breaks) > 0.0)
    if not increasing or not np.all(np.isfinite(breaks)):
        raise InputError(
            f"breakpoints of {name}: {breaks.tolist()};"
            " two or more finite numbers are required, each larger than the one before"
        )
    breaks.setflags(write=False)
    return breaks


def _spread(breaks: np.ndarray, count: int, closed: bool) -> np.ndarray:
    """Return ``count`` samples from each breakpoint to the next, and the end if it is open."""
    parts = np.arange(count) / count
    inner = (breaks[:-1, None] + np.diff(breaks)[:, None] * parts).ravel()
    return inner if closed else np.append(inner, breaks[-1])


# Between two axes, as the sine of the angle.
_LEAST_ANGLE = 1e-3


def checked_placement(
    origin: ArrayLike, rotation: ArrayLike | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return origin [3], m, and rotation [3, 3] of a surface as arrays, the identity by default.

    Raises:
        InputError: Not three finite numbers, or not a rotation.
    """
    o = np.asarray(origin, dtype=float)
    if o.shape != (3,) or not np.all(np.isfinite(o)):
        raise InputError(f"surface origin: {o.tolist()}; 3 finite numbers, in m, are required")
    if rotation is None:
        return o, np.eye(3)
    R = check_rotation_matrix(rotation, "surface rotation")
    if R.shape != (3, 3):
        raise InputError(f"surface rotation: shape {R.shape}; (3, 3) is required")
    return o, R


def rotation_from_axes(axis: ArrayLike, start: ArrayLike | None = None) -> np.ndarray:
    """Return the rotation with a prescribed z-axis, and its x-axis as near as possible to another.

    Args:
        axis: Direction of the z-axis, of any length, [3].
        start: Direction that the x-axis leans to, [3]; by default the world's x-axis, or its y-axis
            where z is along x.

    Returns:
        Rotation matrix [3, 3].

    Raises:
        InputError: An invalid direction, or both along one line.
    """
    z = _direction("axis", axis)
    if start is None:
        upright = np.hypot(z[1], z[2]) <= _LEAST_ANGLE
        start = (0.0, 1.0, 0.0) if upright else (1.0, 0.0, 0.0)
    y = np.cross(z, _direction("start", start))
    if not np.linalg.norm(y) > _LEAST_ANGLE:
        raise InputError(
            f"start: {np.asarray(start).tolist()}; a direction that is not along"
            f" axis = {np.asarray(axis).tolist()} is required"
        )
    y /= np.linalg.norm(y)
    return np.column_stack([np.cross(y, z), y, z])


def _direction(name: str, vector: ArrayLike) -> np.ndarray:
    v = np.asarray(vector, dtype=float)
    if v.shape != (3,) or not np.all(np.isfinite(v)) or not np.any(v):
        raise InputError(f"{name}: {v.tolist()}; 3 finite numbers, not all zero, are required")
    v = v / np.abs(v).max()  # squares of huge or tiny numbers overflow or vanish
    return np.asarray(v / np.linalg.norm(v))
