"""Planes: rectangles and half-spaces."""

import dataclasses as dc
from collections.abc import Sequence

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve
from pfsc_drake.geometry.regions.region import (
    FormulaRegion,
    Region,
    Symbol,
    axes_along,
    checked_point,
)
from pfsc_drake.geometry.shapes.revolution import checked_ends
from pfsc_drake.geometry.shapes.shape import (
    Pair,
    PlacedSurface,
    ShapeInputs,
    SurfaceResult,
    pair,
    require_ends,
)
from pfsc_drake.geometry.surfaces.parametric_surface import checked_placement
from pfsc_drake.geometry.surfaces.product import ProductSurface, translated_surface


@dc.dataclass
class OverRectangle(PlacedSurface):
    """A surface over a rectangle; theta_1 and theta_2 are its coordinates [m].

    Attributes:
        first: First and last theta_1 [m].
        second: First and last theta_2 [m].
    """

    first: list[float] = dc.field(default_factory=lambda: [-0.2, 0.2])
    second: list[float] = dc.field(default_factory=lambda: [-0.2, 0.2])

    def __post_init__(self) -> None:
        super().__post_init__()
        for key in ("first", "second"):
            require_ends(key, getattr(self, key))

    @property
    def size(self) -> tuple[Pair, Pair]:
        """First and last of both parameters [m]."""
        return pair(self.first), pair(self.second)


@dc.dataclass
class Plane(OverRectangle):
    """A rectangle; its third axis is the normal."""

    @property
    def encloses(self) -> bool:
        """Whether it has an inside."""
        return False

    def surface(self, inputs: ShapeInputs) -> SurfaceResult:
        """Return the surface, whatever its class."""
        return SurfaceResult(plane(self.size, self.origin, self.rotation))

    def region(self, inputs: ShapeInputs, *, inside: bool) -> Region:
        """Return the region that it bounds."""
        return HalfSpace(self.origin, np.negative(self.axis) if inside else self.axis)


def plane(
    size: Sequence[float | Pair],
    origin: ArrayLike = (0.0, 0.0, 0.0),
    rotation: ArrayLike | None = None,
) -> ProductSurface:
    """Return the rectangle o + theta_1 e_x + theta_2 e_y, the normal being e_z.

    Args:
        size: Largest theta_1 and theta_2, from zero, m; or first and last of each.
        origin: o, [3], m.
        rotation: Columns e, [3, 3]; the identity by default.

    Raises:
        InputError: An invalid size or placement.
    """
    return graph(size, 0.0, origin, rotation)


def graph(
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
        begin, end = checked_ends(f"theta_{axis + 1}", ends)
        height = coefficient * R[:, 2]
        start = begin * R[:, axis] + begin**2 * height + (o if axis == 0 else 0.0)
        slope = R[:, axis] + 2.0 * begin * height
        powers = [start, slope, height] if coefficient else [start, slope]
        curves.append(PiecewisePolynomialCurve([begin, end], [powers]))
    return translated_surface(*curves)


class HalfSpace(FormulaRegion):
    """The side of a plane that a normal points to.

    Args:
        point: Point on the plane, [3], m.
        normal: Into the admissible region, of any length, [3].

    Raises:
        InputError: No point or no direction.
    """

    def __init__(self, point: ArrayLike, normal: ArrayLike) -> None:
        self._normal = ca.DM(axes_along(normal)[2])
        self._point = ca.DM(checked_point("point", point))

    def formula(self, point: Symbol) -> tuple[Symbol, Symbol]:
        """Return the signed distance and normal as expressions."""
        return ca.dot(self._normal, point - self._point), ca.SX(self._normal)
