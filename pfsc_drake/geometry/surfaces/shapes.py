"""Planes, cylinders, cones, spheres, tori and paraboloids."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.fourier import FourierCurve
from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve
from pfsc_drake.geometry.surfaces.generated import surface_of_revolution, translated_surface
from pfsc_drake.geometry.surfaces.product import ProductSurface
from pfsc_drake.geometry.surfaces.surface import checked_placement

Pair = tuple[float, float]


class Turned(NamedTuple):
    """What all surfaces of revolution have in common.

    Attributes:
        origin: On the axis, [3], m.
        rotation: Its third column is the axis, its first the direction theta_1 = 0, [3, 3];
            the identity by default.
        angles: First and last theta_1, rad; a closed turn by default.
        inward: Whether the normal points inwards; theta_1 then runs the other way.
    """

    origin: ArrayLike = (0.0, 0.0, 0.0)
    rotation: ArrayLike | None = None
    angles: Pair | None = None
    inward: bool = False


def plane(
    size: Sequence[float | Pair],
    origin: ArrayLike = (0.0, 0.0, 0.0),
    rotation: ArrayLike | None = None,
) -> ProductSurface:
    """Rectangle o + theta_1 e_x + theta_2 e_y, the normal being e_z.

    Args:
        size: Largest theta_1 and theta_2, from zero, m; or first and last of each.
        origin: o, [3], m.
        rotation: Columns e, [3, 3]; the identity by default.

    Raises:
        InputError: A size or placement that is none.
    """
    return _graph(size, 0.0, origin, rotation)


def paraboloid(
    size: Sequence[float | Pair],
    coefficient: float,
    origin: ArrayLike = (0.0, 0.0, 0.0),
    rotation: ArrayLike | None = None,
) -> ProductSurface:
    """Paraboloid of revolution as a graph, (4.53), (4.54).

    sigma = o + theta_1 e_x + theta_2 e_y + c (theta_1^2 + theta_2^2) e_z; the normal points
    along e_z at the vertex, where the radius of curvature is 1 / (2 c).

    Args:
        size: Largest theta_1 and theta_2, from zero, m; or first and last of each.
        coefficient: c, 1/m.
        origin: Vertex o, [3], m.
        rotation: Columns e, [3, 3]; the identity by default.

    Raises:
        InputError: A size, coefficient or placement that is none.
    """
    if not math.isfinite(coefficient):
        raise InputError(f"paraboloid coefficient: {coefficient}; a finite number is required")
    return _graph(size, coefficient, origin, rotation)


def cylinder(radius: float, heights: Pair, turned: Turned | None = None) -> ProductSurface:
    """Cylinder; theta_1 is the angle, theta_2 the height along the axis, m, (4.50).

    (4.50) is ``cylinder(r, heights, Turned((0, 0, c), rotation_from_axes(y, x), inward=True))``.

    Args:
        radius: m, positive.
        heights: First and last theta_2, m.
        turned: Placement, angles and side.

    Raises:
        InputError: Numbers that are no cylinder.
    """
    _check_positive("cylinder radius", radius)
    return _turned_line((radius, 0.0), (0.0, 1.0), heights, turned)


def cone(opening_angle: float, distances: Pair, turned: Turned | None = None) -> ProductSurface:
    """Cone whose apex is the origin; theta_2 is the distance from it along the surface, m.

    Args:
        opening_angle: Between the axis and the surface, rad, above 0 and below pi/2.
        distances: First and last theta_2, m, positive: the apex is no part of it.
        turned: Placement, angles and side.

    Raises:
        InputError: Numbers that are no cone, or one with its apex.
    """
    if not 0.0 < opening_angle < math.pi / 2.0:
        raise InputError(
            f"cone opening_angle: {opening_angle} rad; above 0 and below pi/2 is required"
        )
    if not distances[0] > 0.0:
        raise InputError(
            f"cone distances: {list(distances)} m; must be positive, a cone has no normal at its"
            " apex"
        )
    slope = (math.sin(opening_angle), math.cos(opening_angle))
    return _turned_line((0.0, 0.0), slope, distances, turned)


def sphere(radius: float, latitudes: Pair, turned: Turned | None = None) -> ProductSurface:
    """Part of a sphere between two latitudes; theta_1 is the longitude, theta_2 the latitude, rad.

    Args:
        radius: m, positive.
        latitudes: First and last theta_2, rad, between -pi/2 and pi/2 and without these: poles.
        turned: Placement (the origin is the centre, the third axis points to the north), angles and
            side. To have the parametrization even, turn the patch to the equator.

    Raises:
        InputError: Numbers that are no sphere, or a part with a pole.
    """
    _check_positive("sphere radius", radius)
    pole = math.pi / 2.0
    if not -pole < latitudes[0] < latitudes[1] < pole:
        raise InputError(
            f"sphere latitudes: {list(latitudes)} rad; must increase between -pi/2 and pi/2 without"
            " the poles, where longitudes are undefined"
        )
    profile = FourierCurve.circle((0.0, 0.0), radius, (1.0, 0.0), (0.0, 1.0))
    return surface_of_revolution(profile, part=latitudes, **(turned or Turned())._asdict())


def torus(
    ring_radius: float,
    tube_radius: float,
    turned: Turned | None = None,
    part: Pair | None = None,
) -> ProductSurface:
    """Torus; theta_1 goes round the axis, theta_2 round the tube from its outermost line, rad.

    Args:
        ring_radius: From the axis to the middle of the tube, m.
        tube_radius: m, positive and smaller.
        turned: Placement, angles and side.
        part: First and last theta_2; closed by default.

    Raises:
        InputError: Numbers that are no torus.
    """
    _check_positive("torus tube_radius", tube_radius)
    if not tube_radius < ring_radius < math.inf:
        raise InputError(
            f"torus ring_radius: {ring_radius} m; more than tube_radius = {tube_radius} m is"
            " required"
        )
    profile = FourierCurve.circle((ring_radius, 0.0), tube_radius, (1.0, 0.0), (0.0, 1.0))
    return surface_of_revolution(profile, part=part, **(turned or Turned())._asdict())


def _turned_line(start: Pair, slope: Pair, ends: Pair, turned: Turned | None) -> ProductSurface:
    """Revolution of the line start + theta_2 slope."""
    begin, end = _checked_ends("theta_2", ends)
    table = np.array([[np.add(start, np.multiply(slope, begin)), slope]])
    profile = PiecewisePolynomialCurve([begin, end], table)
    return surface_of_revolution(profile, **(turned or Turned())._asdict())


def _graph(
    size: Sequence[float | Pair],
    coefficient: float,
    origin: ArrayLike,
    rotation: ArrayLike | None,
) -> ProductSurface:
    """Return o + theta_1 e_x + theta_2 e_y + c (theta_1^2 + theta_2^2) e_z."""
    o, R = checked_placement(origin, rotation)
    curves = []
    for axis, values in enumerate(size):
        ends = values if isinstance(values, Sequence) else (0.0, values)
        begin, end = _checked_ends(f"theta_{axis + 1}", ends)
        height = coefficient * R[:, 2]
        start = begin * R[:, axis] + begin**2 * height + (o if axis == 0 else 0.0)
        slope = R[:, axis] + 2.0 * begin * height
        powers = [start, slope, height] if coefficient else [start, slope]
        curves.append(PiecewisePolynomialCurve([begin, end], [powers]))
    return translated_surface(*curves)


def _checked_ends(name: str, ends: Sequence[float]) -> Pair:
    begin, end = ends
    if not (math.isfinite(begin) and math.isfinite(end) and begin < end):
        raise InputError(
            f"{name}: from {begin} to {end}; finite numbers that increase are required"
        )
    return float(begin), float(end)


def _check_positive(name: str, value: float) -> None:
    if not 0.0 < value < math.inf:
        raise InputError(f"{name}: {value} m; a positive number of metres is required")
