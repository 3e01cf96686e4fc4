"""Cylinders."""

import dataclasses as dc

import casadi as ca
from numpy.typing import ArrayLike

from pfsc_drake.geometry.regions.region import (
    Region,
    Symbol,
    checked_length,
)
from pfsc_drake.geometry.shapes.revolution import (
    Meridian,
    OfRevolution,
    Turned,
    TurnedRegion,
    check_positive,
    turned_line,
)
from pfsc_drake.geometry.shapes.shape import Pair, ShapeInputs, SurfaceResult, pair, require_ends
from pfsc_drake.geometry.surfaces.product import ProductSurface
from pfsc_drake.yaml.rules import Length


@dc.dataclass
class Cylinder(OfRevolution):
    """A cylinder (4.50); theta_2 is the height along its axis.

    Attributes:
        radius: [m].
        heights: First and last theta_2 [m].
    """

    radius: Length = 0.1
    heights: list[float] = dc.field(default_factory=lambda: [-0.2, 0.2])

    def __post_init__(self) -> None:
        super().__post_init__()
        require_ends("heights", self.heights)

    def surface(self, inputs: ShapeInputs) -> SurfaceResult:
        """Return the surface, whatever its class."""
        return SurfaceResult(cylinder(self.radius, pair(self.heights), self.turned))

    def region(self, inputs: ShapeInputs, *, inside: bool) -> Region:
        """Return the region that it bounds."""
        return CylinderRegion(self.radius, self.origin, self.axis, inside=inside)


def cylinder(radius: float, heights: Pair, turned: Turned | None = None) -> ProductSurface:
    """Return a cylinder; theta_1 is the angle, theta_2 the height along the axis, m, (4.50).

    (4.50) is ``cylinder(r, heights, Turned((0, 0, c), rotation_from_axes(y, x), inward=True))``.

    Args:
        radius: m, positive.
        heights: First and last theta_2, m.
        turned: Placement, angles and side.

    Raises:
        InputError: Numbers that are no cylinder.
    """
    check_positive("cylinder radius", radius)
    return turned_line((radius, 0.0), (0.0, 1.0), heights, turned)


class CylinderRegion(TurnedRegion):
    """Region inside or outside a cylinder.

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
        """Return the distance in a half-plane that ends at the axis."""
        return rho - self._radius, ca.SX(1.0), ca.SX(0.0)
