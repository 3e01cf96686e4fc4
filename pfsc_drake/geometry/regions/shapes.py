"""Regions bounded by planes, spheres, cylinders, cones and tori, which have no ends."""

import math
from abc import abstractmethod

from numpy.typing import ArrayLike

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.regions.placement import axes_along, checked_length, checked_point
from pfsc_drake.geometry.regions.region import Distance, Region

# A bound, safe from rounding errors.
_ABOVE = 1.0 + 1e-15

Meridian = tuple[float, float, float]


class HalfSpace(Region):
    """The side of a plane that a normal points to.

    Args:
        point: On the plane, [3], m.
        normal: Into the admissible region, of any length, [3].

    Raises:
        InputError: No point or no direction.
    """

    def __init__(self, point: ArrayLike, normal: ArrayLike) -> None:
        a, b, c = axes_along(normal)[2].tolist()
        x, y, z = checked_point("point", point)
        self._normal, self._offset = (a, b, c), a * x + b * y + c * z

    def distance(self, x: float, y: float, z: float) -> Distance:
        """See the base class."""
        a, b, c = self._normal
        return a * x + b * y + c * z - self._offset, a, b, c


class SphereRegion(Region):
    """What lies inside or outside a sphere.

    Args:
        centre: [3], m.
        radius: m, positive.
        inside: Whether the ball is admissible, not what surrounds it.

    Raises:
        InputError: Numbers that are no sphere.
    """

    def __init__(self, centre: ArrayLike, radius: float, *, inside: bool) -> None:
        self._centre = checked_point("centre", centre)
        self._radius = checked_length("radius", radius)
        self._sign = -1.0 if inside else 1.0

    def distance(self, x: float, y: float, z: float) -> Distance:
        """See the base class."""
        a, b, c = self._centre
        x, y, z = x - a, y - b, z - c
        length = math.sqrt(x * x + y * y + z * z)
        sign = self._sign
        if not length:
            return -sign * self._radius, sign, 0.0, 0.0
        scale = sign / length
        return sign * (length - self._radius), scale * x, scale * y, scale * z


class TurnedRegion(Region):
    """What lies inside or outside a surface of revolution.

    Args:
        origin: On the axis, [3], m.
        axis: Of any length, [3].
        inside: Whether the side of the axis is admissible, not the other one.

    Raises:
        InputError: No point or no direction.
    """

    def __init__(self, origin: ArrayLike, axis: ArrayLike, *, inside: bool) -> None:
        self._origin = checked_point("origin", origin)
        self._axes = tuple(axes_along(axis).ravel().tolist())
        self._sign = -1.0 if inside else 1.0

    @abstractmethod
    def meridian(self, rho: float, height: float) -> Meridian:
        """Distance in a half-plane that ends at the axis.

        Args:
            rho: Distance from the axis, m.
            height: Along the axis from the origin, m.

        Returns:
            Distance of the meridian curve, positive outside, m, and its derivatives with respect to
            rho and the height.
        """

    def distance(self, x: float, y: float, z: float) -> Distance:
        """See the base class."""
        a, b, c = self._origin
        x, y, z = x - a, y - b, z - c
        ax, ay, az, bx, by, bz, cx, cy, cz = self._axes
        a, b, c = ax * x + ay * y + az * z, bx * x + by * y + bz * z, cx * x + cy * y + cz * z
        rho = math.sqrt(a * a + b * b)
        h, radial, axial = self.meridian(rho, c)
        sign = self._sign
        axial *= sign
        if rho:
            radial *= sign / rho
            a, b = radial * a, radial * b
        else:
            a = sign * radial
        return (
            sign * h,
            a * ax + b * bx + axial * cx,
            a * ay + b * by + axial * cy,
            a * az + b * bz + axial * cz,
        )


class CylinderRegion(TurnedRegion):
    """What lies inside or outside a cylinder.

    Args:
        radius: m, positive.
        origin: See :class:`TurnedRegion`.
        axis: See there.
        inside: See there.

    Raises:
        InputError: Numbers that are no cylinder.
    """

    def __init__(self, radius: float, origin: ArrayLike, axis: ArrayLike, *, inside: bool) -> None:
        super().__init__(origin, axis, inside=inside)
        self._radius = checked_length("radius", radius)

    def meridian(self, rho: float, height: float) -> Meridian:
        """See the base class."""
        return rho - self._radius, 1.0, 0.0


class ConeRegion(TurnedRegion):
    """What lies inside or outside a cone, with its apex.

    Args:
        opening_angle: Between the axis and the surface, rad, above 0 and below pi/2.
        origin: The apex, [3], m.
        axis: Into the cone, of any length, [3].
        inside: See :class:`TurnedRegion`.

    Raises:
        InputError: Numbers that are no cone.
    """

    def __init__(
        self, opening_angle: float, origin: ArrayLike, axis: ArrayLike, *, inside: bool
    ) -> None:
        super().__init__(origin, axis, inside=inside)
        if not 0.0 < opening_angle < math.pi / 2.0:
            raise InputError(
                f"region opening_angle: {opening_angle} rad; above 0 and below pi/2 is required"
            )
        self._slope = (math.sin(opening_angle), math.cos(opening_angle))

    def meridian(self, rho: float, height: float) -> Meridian:
        """See the base class."""
        sine, cosine = self._slope
        if rho * sine + height * cosine > 0.0:
            return rho * cosine - height * sine, cosine, -sine
        length = math.hypot(rho, height)
        if not length:
            return 0.0, 0.0, -1.0
        return length, rho / length, height / length


class TorusRegion(TurnedRegion):
    """What lies inside or outside the tube of a torus.

    Args:
        ring_radius: From the axis to the middle of the tube, m.
        tube_radius: m, positive and smaller.
        origin: See :class:`TurnedRegion`.
        axis: See there.
        inside: Whether the tube's inside is admissible, not what surrounds it.

    Raises:
        InputError: Numbers that are no torus.
    """

    def __init__(
        self,
        ring_radius: float,
        tube_radius: float,
        origin: ArrayLike,
        axis: ArrayLike,
        *,
        inside: bool,
    ) -> None:
        super().__init__(origin, axis, inside=inside)
        self._tube = checked_length("tube_radius", tube_radius)
        if not tube_radius < ring_radius < math.inf:
            raise InputError(
                f"region ring_radius: {ring_radius} m; more than tube_radius = {tube_radius} m is"
                " required"
            )
        self._ring = float(ring_radius)

    def meridian(self, rho: float, height: float) -> Meridian:
        """See the base class."""
        x = rho - self._ring
        length = math.hypot(x, height)
        if not length:
            return -self._tube, 1.0, 0.0
        return length - self._tube, x / length, height / length


class ParaboloidRegion(TurnedRegion):
    """What lies inside or outside a paraboloid of revolution, (4.53) without its end.

    Where it shall end, another region does so: one that stands on a plane goes on below that, where
    nothing is admissible anyhow.

    Args:
        coefficient: c of the height c rho^2 over the vertex, 1/m, not zero.
        origin: The vertex, [3], m.
        axis: Direction of positive heights, of any length, [3].
        inside: See :class:`TurnedRegion`.

    Raises:
        InputError: Numbers that are no paraboloid.
    """

    def __init__(
        self, coefficient: float, origin: ArrayLike, axis: ArrayLike, *, inside: bool
    ) -> None:
        super().__init__(origin, axis, inside=inside)
        if not 0.0 < abs(coefficient) < math.inf:
            raise InputError(
                f"region coefficient: {coefficient}; a finite number that is not zero is required"
            )
        self._coefficient = abs(float(coefficient))
        self._upwards = math.copysign(1.0, coefficient)

    def meridian(self, rho: float, height: float) -> Meridian:
        """See the base class.

        The foot is at the largest root of a cubic. Newton's method falls monotonically to it from
        above, so it has converged when it falls no longer.
        """
        c = self._coefficient
        height *= self._upwards
        # u = c times the radius of the foot: u^3 + p u = q
        p, q = 0.5 - c * height, 0.5 * c * rho
        if not q:
            u = math.sqrt(-p) if p < 0.0 else 0.0
        else:
            u = q ** (1.0 / 3.0)
            if p < 0.0:
                u += math.sqrt(-p)
            elif u * p > q:
                u = q / p
            u *= _ABOVE
            last = math.inf
            while u < last:
                last = u
                u = (2.0 * u * u * u + q) / (3.0 * u * u + p)
        slope = 2.0 * u
        norm = 1.0 / math.sqrt(1.0 + slope * slope)
        h = ((rho - u / c) * slope - height + u * u / c) * norm
        return h, slope * norm, -norm * self._upwards
