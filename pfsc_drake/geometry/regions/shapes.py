"""Regions bounded by planes, spheres, cylinders, cones and tori, which have no ends."""

import math
from abc import abstractmethod

import casadi as ca
from numpy.typing import ArrayLike

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.regions.region import (
    FormulaRegion,
    Symbol,
    axes_along,
    checked_length,
    checked_point,
    direction,
)

# A bound, safe from rounding errors.
_ABOVE = 1.0 + 1e-15
# Newton's steps to the foot on a paraboloid, from 1e-12 to 1e12 in p and q.
_STEPS = 8

Meridian = tuple[Symbol, Symbol, Symbol]


class HalfSpace(FormulaRegion):
    """The side of a plane that a normal points to.

    Args:
        point: On the plane, [3], m.
        normal: Into the admissible region, of any length, [3].

    Raises:
        InputError: No point or no direction.
    """

    def __init__(self, point: ArrayLike, normal: ArrayLike) -> None:
        self._normal = ca.DM(axes_along(normal)[2])
        self._point = ca.DM(checked_point("point", point))

    def formula(self, point: Symbol) -> tuple[Symbol, Symbol]:
        """Signed distance and normal as expressions."""
        return ca.dot(self._normal, point - self._point), ca.SX(self._normal)


class SphereRegion(FormulaRegion):
    """What lies inside or outside a sphere.

    Args:
        centre: [3], m.
        radius: m, positive.
        inside: Whether the ball is admissible, not what surrounds it.

    Raises:
        InputError: Numbers that are no sphere.
    """

    def __init__(self, centre: ArrayLike, radius: float, *, inside: bool) -> None:
        self._centre = ca.DM(checked_point("centre", centre))
        self._radius = checked_length("radius", radius)
        self._sign = -1.0 if inside else 1.0

    def formula(self, point: Symbol) -> tuple[Symbol, Symbol]:
        """Signed distance and normal as expressions."""
        away, outwards = direction(point - self._centre, (1.0, 0.0, 0.0))
        return self._sign * (away - self._radius), self._sign * outwards


class TurnedRegion(FormulaRegion):
    """What lies inside or outside a surface of revolution.

    Args:
        origin: On the axis, [3], m.
        axis: Vector along the axis, of any length, [3].
        inside: Whether the side of the axis is admissible, not the other one.

    Raises:
        InputError: No point or no direction.
    """

    def __init__(self, origin: ArrayLike, axis: ArrayLike, *, inside: bool) -> None:
        self._origin = ca.DM(checked_point("origin", origin))
        self._axes = ca.DM(axes_along(axis))
        self._sign = -1.0 if inside else 1.0

    @abstractmethod
    def meridian(self, rho: Symbol, height: Symbol) -> Meridian:
        """Distance in a half-plane that ends at the axis.

        Args:
            rho: Distance from the axis, m.
            height: Along the axis from the origin, m.

        Returns:
            Distance of the meridian curve, positive outside, m, and its derivatives with respect to
            rho and the height.
        """

    def formula(self, point: Symbol) -> tuple[Symbol, Symbol]:
        """Signed distance and normal as expressions."""
        local = self._axes @ (point - self._origin)
        rho, outwards = direction(local[:2], (1.0, 0.0))
        h, radial, axial = self.meridian(rho, local[2])
        return self._sign * h, self._sign * (self._axes.T @ ca.vertcat(radial * outwards, axial))


class CylinderRegion(TurnedRegion):
    """What lies inside or outside a cylinder.

    Args:
        radius: m, positive.
        origin: Point on the axis, [3], m.
        axis: Vector along the axis, of any length, [3].
        inside: Whether the side of the axis is admissible, not the other one.

    Raises:
        InputError: Numbers that are no cylinder.
    """

    def __init__(self, radius: float, origin: ArrayLike, axis: ArrayLike, *, inside: bool) -> None:
        super().__init__(origin, axis, inside=inside)
        self._radius = checked_length("radius", radius)

    def meridian(self, rho: Symbol, height: Symbol) -> Meridian:
        """Distance in a half-plane that ends at the axis."""
        return rho - self._radius, ca.SX(1.0), ca.SX(0.0)


class ConeRegion(TurnedRegion):
    """What lies inside or outside a cone, with its apex.

    Args:
        opening_angle: Between the axis and the surface, rad, above 0 and below pi/2.
        origin: The apex, [3], m.
        axis: Into the cone, of any length, [3].
        inside: Whether the side of the axis is admissible, not the other one.

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

    def meridian(self, rho: Symbol, height: Symbol) -> Meridian:
        """Distance in a half-plane that ends at the axis."""
        sine, cosine = self._slope
        beyond_apex = rho * sine + height * cosine <= 0.0
        from_apex, n = direction(ca.vertcat(rho, height), (0.0, -1.0))
        return (
            ca.if_else(beyond_apex, from_apex, rho * cosine - height * sine),
            ca.if_else(beyond_apex, n[0], cosine),
            ca.if_else(beyond_apex, n[1], -sine),
        )


class TorusRegion(TurnedRegion):
    """What lies inside or outside the tube of a torus.

    Args:
        ring_radius: From the axis to the middle of the tube, m.
        tube_radius: m, positive and smaller.
        origin: Point on the axis, [3], m.
        axis: Vector along the axis, of any length, [3].
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

    def meridian(self, rho: Symbol, height: Symbol) -> Meridian:
        """Distance in a half-plane that ends at the axis."""
        away, n = direction(ca.vertcat(rho - self._ring, height), (1.0, 0.0))
        return away - self._tube, n[0], n[1]


class ParaboloidRegion(TurnedRegion):
    """What lies inside or outside a paraboloid of revolution, (4.53) without its end.

    Where it shall end, another region does so: one that stands on a plane goes on below that, where
    nothing is admissible anyhow.

    Args:
        coefficient: c of the height c rho^2 over the vertex, 1/m, not zero.
        origin: The vertex, [3], m.
        axis: Direction of positive heights, of any length, [3].
        inside: Whether the side of the axis is admissible, not the other one.

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

    def meridian(self, rho: Symbol, height: Symbol) -> Meridian:
        """Distance in a half-plane that ends at the axis.

        The foot is at the largest root of a cubic, ``u^3 + p u = q`` with u = c times its radius.
        Newton's method falls monotonically to it from above, and stays where it falls no longer.
        """
        c = self._coefficient
        height = height * self._upwards
        p, q = 0.5 - c * height, 0.5 * c * rho
        cube_root = q ** (1.0 / 3.0)
        bound = ca.if_else(
            p < 0.0,
            cube_root + ca.sqrt(ca.fmax(-p, 0.0)),
            ca.if_else(cube_root * p > q, q / ca.if_else(p > 0.0, p, 1.0), cube_root),
        )
        u = _ABOVE * bound
        for _ in range(_STEPS):
            u = ca.fmin(u, (2.0 * u * u * u + q) / (3.0 * u * u + p))
        slope = 2.0 * u
        norm = 1.0 / ca.sqrt(1.0 + slope * slope)
        h = ((rho - u / c) * slope - height + u * u / c) * norm
        return h, slope * norm, -norm * self._upwards
