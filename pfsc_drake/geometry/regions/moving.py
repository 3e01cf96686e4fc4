"""Regions with a prescribed motion over their own clock."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property
from typing import Protocol

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.compiled.bound_function import PlainFunction
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.polynomial import PieceTable, PiecewisePolynomialCurve
from pfsc_drake.geometry.regions.region import Distance, Region, axes_along, checked_point

# Largest jumps of a repeated motion, relative to its extent and to its rates.
_SAME = 1e-9


class Motion(Protocol):
    """Coordinate of a motion over a clock, of class C^2.

    Attributes:
        largest_rate: Largest absolute rate, m/s or rad/s.
    """

    largest_rate: float

    def at(self, clock: ca.MX) -> ca.MX:
        """Return the value at a time of the clock [s], m or rad, as an expression."""


class CurveMotion:
    """Motion along a curve of dimension 1, whose parameter is the clock.

    Args:
        curve: Curve of class C^2, at rest at its ends; before and after it the motion rests.
        repeat: Whether the motion is repeated.

    Attributes:
        largest_rate: Largest absolute rate, m/s or rad/s.

    Raises:
        InputError: The curve has another dimension, is not of class C^2, or is repeated and ends
            elsewhere than it begins.
    """

    def __init__(self, curve: PiecewisePolynomialCurve, *, repeat: bool = False) -> None:
        if curve.dimension != 1 or curve.smoothness < 2:
            raise InputError(
                f"motion: dimension {curve.dimension}, class C^{curve.smoothness:g}; 1 and C^2 or"
                " smoother are required"
            )
        self._begin, self._end = curve.domain
        self._period = curve.period
        self._repeat = repeat
        self._table = PieceTable(curve.breakpoints, curve.coefficients.transpose(0, 2, 1))
        ends = curve.derivatives(np.array(curve.domain), 2)[..., 0]
        extent = np.ptp(curve.derivatives(np.linspace(*curve.domain, 1001), 0))
        scales = extent / self._period ** np.arange(3)
        rates = np.abs(ends[:, 1:]) > _SAME * scales[1:]
        if np.any(rates):
            raise InputError(
                f"motion: moves by {ends[:, 1].tolist()} a second at its ends; must be at rest"
                " there"
            )
        if repeat and abs(ends[1, 0] - ends[0, 0]) > _SAME * extent:
            raise InputError(
                f"motion: begins at {ends[0, 0]:g} and ends at {ends[1, 0]:g}; both must be the"
                " same for it to repeat"
            )
        self.largest_rate = _largest_rate(curve)

    def at(self, clock: ca.MX) -> ca.MX:
        """Return the value at a time of the clock [s], m or rad, as an expression."""
        if self._repeat:
            periods = ca.floor((clock - self._begin) / self._period)
            clock = clock - periods * self._period
        return self._table(ca.fmin(ca.fmax(clock, self._begin), self._end))


class CurveCourse(CurveMotion):
    """Former name of :class:`CurveMotion`, for existing scripts."""


def _largest_rate(curve: PiecewisePolynomialCurve) -> float:
    """Return the largest rate, at ends of pieces or where the second derivative vanishes."""
    largest = 0.0
    for length, powers in zip(np.diff(curve.breakpoints), curve.coefficients[..., 0], strict=True):
        rate = np.polynomial.Polynomial(powers).deriv()
        turns = np.asarray(rate.deriv().roots(), dtype=complex).real
        within = turns[(turns > 0.0) & (turns < length)]
        largest = max(largest, float(np.abs(rate(np.array([0.0, length, *within]))).max()))
    return largest


class MovingRegion(ABC):
    """Admissible region whose boundary moves as a rigid body.

    At any time of its clock it has the distance of a :class:`Region`. Its motion is given by
    expressions.

    Args:
        region: The region at zero displacement.
        motion: Displacement over the clock.
    """

    def __init__(self, region: Region, motion: Motion) -> None:
        self._region, self._motion = region, motion

    @abstractmethod
    def at_rest(self, point: ca.MX, clock: ca.MX) -> ca.MX:
        """Return a point in the frame of the moving region, [3], m.

        The frame coincides with the world's at zero displacement.

        Args:
            point: World axes, [3], m.
            clock: s.
        """

    @abstractmethod
    def rotate(self, vector: ca.MX, clock: ca.MX) -> ca.MX:
        """Return the direction in the world of a vector that moves with the region, [3].

        Args:
            vector: The vector at zero displacement, [3].
            clock: s.
        """

    @abstractmethod
    def displacement(self, point: ca.MX, clock: ca.MX, clock_next: ca.MX) -> ca.MX:
        """Return the displacement of a point of the moving region between two times, [3], m.

        Args:
            point: Its position at the first time, world axes, [3], m.
            clock: s.
            clock_next: s.
        """

    @abstractmethod
    def largest_speed(self, centre: ArrayLike, radius: float) -> float:
        """Return the largest speed of points of the moving region within a sphere, m/s.

        No distance of a resting point there changes faster while the clock runs at the rate of
        time.

        Args:
            centre: [3], m.
            radius: m.
        """

    @cached_property
    def signed_distance(self) -> ca.Function:
        """The function ``(point, clock) -> (h, n)``, see :attr:`Region.signed_distance`.

        Raises:
            InputError: The distance is no expression; says why.
        """
        point, clock = ca.MX.sym("point", 3), ca.MX.sym("clock")
        h, n = self._region.signed_distance(self.at_rest(point, clock))
        return ca.Function(
            "signed_distance",
            [point, clock],
            [h, self.rotate(n, clock)],
            ["point", "clock"],
            ["h", "n"],
        )

    @cached_property
    def signed_distances(self) -> ca.Function:
        """:meth:`distances_over` of symbols: ``(point, clock, clock_next) -> (h, h_next, n)``.

        Raises:
            InputError: The distance is no expression; says why.
        """
        point, now, then = _point_and_clocks()
        h_next, n = self.signed_distance(point, then)
        h = h_next + ca.dot(n, self.displacement(point, now, then))
        return ca.Function(
            "signed_distances",
            [point, now, then],
            [h, h_next, n],
            ["point", "clock", "clock_next"],
            ["h", "h_next", "n"],
        )

    def distance_at(self, x: float, y: float, z: float, clock: float) -> Distance:
        """Return the signed distance to the boundary at a time of the clock.

        Args:
            x: Coordinate x of the tool point, world axes, finite, m.
            y: Coordinate y, likewise.
            z: Coordinate z, likewise.
            clock: s.

        Returns:
            See :meth:`Region.distance`.
        """
        h, *n = self._region.distance(*self._at_rest(x, y, z, clock))
        return h, *self._rotate(*n, clock)

    def distances_over(
        self, x: float, y: float, z: float, clock: float, clock_next: float
    ) -> Distance:
        """Return the signed distances before and after a motion of the boundary.

        Both are distances to the surface that is the nearest one after the motion.

        Args:
            x: Coordinate x of the tool point, which rests, world axes, finite, m.
            y: Coordinate y, likewise.
            z: Coordinate z, likewise.
            clock: s.
            clock_next: s.

        Returns:
            h before and after, m, and n after.
        """
        h_next, n_x, n_y, n_z = self.distance_at(x, y, z, clock_next)
        w_x, w_y, w_z = self._displacement(x, y, z, clock, clock_next)
        return h_next + n_x * w_x + n_y * w_y + n_z * w_z, h_next, n_x, n_y, n_z

    def placement(self, clock: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the pose of the moving region relative to zero displacement.

        Args:
            clock: s.

        Returns:
            Rotation R, [3, 3], and translation p, [3], m: a point y moves to R y + p.
        """
        rotation = np.array([self._rotate(*axis, clock) for axis in np.eye(3)]).T
        return rotation, -rotation @ self._at_rest(0.0, 0.0, 0.0, clock)

    @cached_property
    def _at_rest(self) -> PlainFunction:
        return PlainFunction(_function_of_clock("at_rest", self.at_rest))

    @cached_property
    def _rotate(self) -> PlainFunction:
        return PlainFunction(_function_of_clock("turned", self.rotate))

    @cached_property
    def _displacement(self) -> PlainFunction:
        arguments = _point_and_clocks()
        return PlainFunction(ca.Function("way", arguments, [self.displacement(*arguments)]))


class ShiftedRegion(MovingRegion):
    """Region that moves along a direction.

    Args:
        region: The region at zero displacement.
        motion: Displacement along the direction [m].
        direction: Direction vector of any length, [3].

    Raises:
        InputError: No direction.
    """

    def __init__(self, region: Region, motion: Motion, direction: ArrayLike) -> None:
        super().__init__(region, motion)
        self._direction = ca.DM(axes_along(direction)[2])

    def at_rest(self, point: ca.MX, clock: ca.MX) -> ca.MX:
        """Return a point in the frame of the moving region, [3], m."""
        return point - self._motion.at(clock) * self._direction

    def rotate(self, vector: ca.MX, clock: ca.MX) -> ca.MX:
        """Return the direction in the world of a vector that moves with the region, [3]."""
        return vector

    def displacement(self, point: ca.MX, clock: ca.MX, clock_next: ca.MX) -> ca.MX:
        """Return the displacement of a point of the moving region between two times, [3], m."""
        return (self._motion.at(clock_next) - self._motion.at(clock)) * self._direction

    def largest_speed(self, centre: ArrayLike, radius: float) -> float:
        """Return the largest speed of points of the moving region within a sphere, m/s."""
        return self._motion.largest_rate


class TurningRegion(MovingRegion):
    """Region that turns about an axis.

    Args:
        region: The region at angle zero.
        motion: Angle about the axis [rad].
        point: Point on the axis, [3], m.
        axis: Vector along the axis, of any length, [3].

    Raises:
        InputError: No point or no direction.
    """

    def __init__(self, region: Region, motion: Motion, point: ArrayLike, axis: ArrayLike) -> None:
        super().__init__(region, motion)
        self._point = np.array(checked_point("point", point))
        self._axes = axes_along(axis)

    def at_rest(self, point: ca.MX, clock: ca.MX) -> ca.MX:
        """Return a point in the frame of the moving region, [3], m."""
        return self._point + self._rotate_by(point - self._point, -self._motion.at(clock))

    def rotate(self, vector: ca.MX, clock: ca.MX) -> ca.MX:
        """Return the direction in the world of a vector that moves with the region, [3]."""
        return self._rotate_by(vector, self._motion.at(clock))

    def displacement(self, point: ca.MX, clock: ca.MX, clock_next: ca.MX) -> ca.MX:
        """Return the displacement of a point of the moving region between two times, [3], m."""
        away, angle = point - self._point, self._motion.at(clock_next) - self._motion.at(clock)
        return self._rotate_by(away, angle) - away

    def largest_speed(self, centre: ArrayLike, radius: float) -> float:
        """Return the largest speed of points of the moving region within a sphere, m/s."""
        away = self._axes[:2] @ (np.asarray(centre, dtype=float) - self._point)
        return self._motion.largest_rate * (float(np.linalg.norm(away)) + radius)

    def _rotate_by(self, vector: ca.MX, angle: ca.MX) -> ca.MX:
        """Return a vector turned about the axis by an angle."""
        across = ca.DM(self._axes[:2])
        u, v = ca.vertsplit(across @ vector)
        cosine, sine = ca.cos(angle), ca.sin(angle)
        change = ca.vertcat(cosine * u - sine * v - u, sine * u + cosine * v - v)
        return vector + across.T @ change


def _point_and_clocks() -> list[ca.MX]:
    return [ca.MX.sym("point", 3), ca.MX.sym("clock"), ca.MX.sym("clock_next")]


def _function_of_clock(name: str, expression: Callable[[ca.MX, ca.MX], ca.MX]) -> ca.Function:
    point, clock, _ = _point_and_clocks()
    return ca.Function(name, [point, clock], [expression(point, clock)])
