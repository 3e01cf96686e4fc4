"""Regions that move as it is prescribed, by a clock of their own."""

import math
from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from pfsc_drake.geometry.regions.course import Course
from pfsc_drake.geometry.regions.placement import Triple, axes_along, checked_point
from pfsc_drake.geometry.regions.region import Distance, Region


class MovingRegion(ABC):
    """An admissible region whose boundary moves.

    At any time of its clock the distance is as that of a :class:`Region`.
    """

    @abstractmethod
    def distance_at(self, x: float, y: float, z: float, clock: float) -> Distance:
        """Signed distance to the boundary where it is at a time of the clock.

        Args:
            x: Of the tool point, world axes, finite, m.
            y: See x.
            z: See x.
            clock: s.

        Returns:
            See :meth:`Region.distance`.
        """

    @abstractmethod
    def way(self, x: float, y: float, z: float, clock: float, clock_next: float) -> Triple:
        """Way from one time of the clock to another of what moves with the region, m.

        Args:
            x: Where it is at first, world axes, m.
            y: See x.
            z: See x.
            clock: s.
            clock_next: s.
        """

    @abstractmethod
    def largest_speed(self, centre: ArrayLike, radius: float) -> float:
        """Largest speed of what moves with the region and is within a sphere, m/s.

        No distance of a point there changes faster while the point rests and the clock runs at the
        pace of time.

        Args:
            centre: [3], m.
            radius: m.
        """

    @abstractmethod
    def placement(self, clock: float) -> tuple[np.ndarray, np.ndarray]:
        """Where what moves with the region is, as seen from where it is at rest.

        Args:
            clock: s.

        Returns:
            Rotation R, [3, 3], and way p, [3], m: a point y at rest has come to R y + p.
        """


class ShiftedRegion(MovingRegion):
    """A region that moves along a direction.

    Args:
        region: Where it is while its course is zero.
        course: Way along the direction [m].
        direction: Of any length, [3].

    Raises:
        InputError: No direction.
    """

    def __init__(self, region: Region, course: Course, direction: ArrayLike) -> None:
        self._distance, self._course = region.distance, course
        a, b, c = axes_along(direction)[2].tolist()
        self._direction = a, b, c

    def distance_at(self, x: float, y: float, z: float, clock: float) -> Distance:
        """See the base class."""
        way = self._course.at(clock)
        a, b, c = self._direction
        return self._distance(x - way * a, y - way * b, z - way * c)

    def way(self, x: float, y: float, z: float, clock: float, clock_next: float) -> Triple:
        """See the base class."""
        way = self._course.at(clock_next) - self._course.at(clock)
        a, b, c = self._direction
        return way * a, way * b, way * c

    def largest_speed(self, centre: ArrayLike, radius: float) -> float:
        """See the base class."""
        return self._course.largest_rate

    def placement(self, clock: float) -> tuple[np.ndarray, np.ndarray]:
        """See the base class."""
        return np.eye(3), self._course.at(clock) * np.array(self._direction)


class TurningRegion(MovingRegion):
    """A region that turns about an axis.

    Args:
        region: Where it is while its course is zero.
        course: Angle about the axis [rad].
        point: On the axis, [3], m.
        axis: Of any length, [3].

    Raises:
        InputError: No point or no direction.
    """

    def __init__(self, region: Region, course: Course, point: ArrayLike, axis: ArrayLike) -> None:
        self._distance, self._course = region.distance, course
        self._point = checked_point("point", point)
        self._axes = axes_along(axis)
        self._flat = tuple(self._axes.ravel().tolist())

    def distance_at(self, x: float, y: float, z: float, clock: float) -> Distance:
        """See the base class."""
        angle = self._course.at(clock)
        cosine, sine = math.cos(angle), math.sin(angle)
        a, b, c = self._point
        x, y, z = self._turned(x - a, y - b, z - c, cosine, -sine)
        h, x, y, z = self._distance(x + a, y + b, z + c)
        return h, *self._turned(x, y, z, cosine, sine)

    def way(self, x: float, y: float, z: float, clock: float, clock_next: float) -> Triple:
        """See the base class."""
        angle = self._course.at(clock_next) - self._course.at(clock)
        a, b, c = self._point
        x, y, z = x - a, y - b, z - c
        a, b, c = self._turned(x, y, z, math.cos(angle), math.sin(angle))
        return a - x, b - y, c - z

    def largest_speed(self, centre: ArrayLike, radius: float) -> float:
        """See the base class."""
        away = self._axes[:2] @ (np.asarray(centre, dtype=float) - self._point)
        return self._course.largest_rate * (float(np.linalg.norm(away)) + radius)

    def placement(self, clock: float) -> tuple[np.ndarray, np.ndarray]:
        """See the base class."""
        rotation = Rotation.from_rotvec(self._course.at(clock) * self._axes[2]).as_matrix()
        return rotation, self._point - rotation @ self._point

    def _turned(
        self, x: float, y: float, z: float, cosine: float, sine: float
    ) -> tuple[float, float, float]:
        """A vector turned about the axis by an angle."""
        ax, ay, az, bx, by, bz, _, _, _ = self._flat
        a, b = ax * x + ay * y + az * z, bx * x + by * y + bz * z
        da, db = cosine * a - sine * b - a, sine * a + cosine * b - b
        return x + da * ax + db * bx, y + da * ay + db * by, z + da * az + db * bz
