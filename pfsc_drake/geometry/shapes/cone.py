"""Cones."""

import dataclasses as dc
import math
from typing import Annotated

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.checks import require
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.regions.region import (
    Region,
    Symbol,
    direction,
)
from pfsc_drake.geometry.shapes.revolution import (
    Meridian,
    OfRevolution,
    Turned,
    TurnedRegion,
    turned_line,
)
from pfsc_drake.geometry.shapes.shape import Pair, ShapeInputs, SurfaceResult, pair, require_ends
from pfsc_drake.geometry.surfaces.product import ProductSurface
from pfsc_drake.yaml.rules import Range


@dc.dataclass
class Cone(OfRevolution):
    """A cone whose apex is its origin; theta_2 is the distance from it along the surface.

    Attributes:
        opening_deg: Angle between axis and surface [deg].
        distances: First and last theta_2 [m], positive.
    """

    opening_deg: Annotated[float, Range(0.0, 90.0, "deg", open=True, below=True)] = 30.0
    distances: list[float] = dc.field(default_factory=lambda: [0.1, 0.4])

    def __post_init__(self) -> None:
        super().__post_init__()
        require_ends("distances", self.distances)
        allowed = "positive numbers of m: a cone has no normal at its apex"
        require(self.distances[0] > 0.0, "distances", self.distances, allowed)

    def surface(self, inputs: ShapeInputs) -> SurfaceResult:
        """Return the surface, whatever its class."""
        return SurfaceResult(
            cone(float(np.deg2rad(self.opening_deg)), pair(self.distances), self.turned)
        )

    def region(self, inputs: ShapeInputs, *, inside: bool) -> Region:
        """Return the region that it bounds."""
        return ConeRegion(math.radians(self.opening_deg), self.origin, self.axis, inside=inside)


def cone(opening_angle: float, distances: Pair, turned: Turned | None = None) -> ProductSurface:
    """Return a cone whose apex is the origin; theta_2 is the distance from it, m.

    Args:
        opening_angle: Angle between axis and surface, rad, above 0 and below pi/2.
        distances: First and last theta_2, m, positive: the apex is no part of it.
        turned: Placement, angles and side.

    Raises:
        InputError: Numbers that define no cone, or one with its apex.
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
    return turned_line((0.0, 0.0), slope, distances, turned)


class ConeRegion(TurnedRegion):
    """Region inside or outside a cone, with its apex.

    Args:
        opening_angle: Angle between axis and surface, rad, above 0 and below pi/2.
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
        """Return the distance in a half-plane that ends at the axis."""
        sine, cosine = self._slope
        beyond_apex = rho * sine + height * cosine <= 0.0
        from_apex, n = direction(ca.vertcat(rho, height), (0.0, -1.0))
        return (
            ca.if_else(beyond_apex, from_apex, rho * cosine - height * sine),
            ca.if_else(beyond_apex, n[0], cosine),
            ca.if_else(beyond_apex, n[1], -sine),
        )
