"""Spheres."""

import dataclasses as dc
import math
from typing import Annotated

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.checks import require
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.fourier_curve import FourierCurve
from pfsc_drake.geometry.regions.region import (
    FormulaRegion,
    Region,
    Symbol,
    checked_length,
    checked_point,
    direction,
)
from pfsc_drake.geometry.shapes.revolution import (
    OfRevolution,
    Turned,
    check_positive,
    surface_of_revolution,
)
from pfsc_drake.geometry.shapes.shape import Pair, ShapeInputs, SurfaceResult, pair
from pfsc_drake.geometry.surfaces.product import ProductSurface
from pfsc_drake.yaml.rules import Length, Numbers


@dc.dataclass
class Sphere(OfRevolution):
    """A part of a sphere about its origin; theta_2 is the latitude.

    Attributes:
        radius: [m].
        latitudes_deg: First and last theta_2 [deg], without the poles.
    """

    radius: Length = 0.2
    latitudes_deg: Annotated[list[float], Numbers(2)] = dc.field(
        default_factory=lambda: [-60.0, 60.0]
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        good = -90.0 < self.latitudes_deg[0] < self.latitudes_deg[1] < 90.0
        allowed = (
            "two numbers that increase between -90 and 90 deg, without the poles, where longitudes "
            "are undefined; turn axis to have a pole elsewhere"
        )
        require(good, "latitudes_deg", self.latitudes_deg, allowed)

    def surface(self, inputs: ShapeInputs) -> SurfaceResult:
        """Return the surface, whatever its class."""
        return SurfaceResult(sphere(self.radius, pair(np.deg2rad(self.latitudes_deg)), self.turned))

    def region(self, inputs: ShapeInputs, *, inside: bool) -> Region:
        """Return the region that it bounds."""
        return SphereRegion(self.origin, self.radius, inside=inside)


def sphere(radius: float, latitudes: Pair, turned: Turned | None = None) -> ProductSurface:
    """Return a sphere between two latitudes; theta_1 is the longitude, theta_2 the latitude, rad.

    Args:
        radius: m, positive.
        latitudes: First and last theta_2, rad, between -pi/2 and pi/2 and without these: poles.
        turned: Placement (the origin is the centre, the third axis points to the north), angles and
            side. To have the parametrization even, turn the patch to the equator.

    Raises:
        InputError: Numbers that are no sphere, or a part with a pole.
    """
    check_positive("sphere radius", radius)
    pole = math.pi / 2.0
    if not -pole < latitudes[0] < latitudes[1] < pole:
        raise InputError(
            f"sphere latitudes: {list(latitudes)} rad; must increase between -pi/2 and pi/2 without"
            " the poles, where longitudes are undefined"
        )
    profile = FourierCurve.circle((0.0, 0.0), radius, (1.0, 0.0), (0.0, 1.0))
    return surface_of_revolution(profile, part=latitudes, **(turned or Turned())._asdict())


class SphereRegion(FormulaRegion):
    """Region inside or outside a sphere.

    Args:
        centre: [3], m.
        radius: m, positive.
        inside: Whether the ball is admissible, not the space around it.

    Raises:
        InputError: Numbers that are no sphere.
    """

    def __init__(self, centre: ArrayLike, radius: float, *, inside: bool) -> None:
        self._centre = ca.DM(checked_point("centre", centre))
        self._radius = checked_length("radius", radius)
        self._sign = -1.0 if inside else 1.0

    def formula(self, point: Symbol) -> tuple[Symbol, Symbol]:
        """Return the signed distance and normal as expressions."""
        away, outwards = direction(point - self._centre, (1.0, 0.0, 0.0))
        return self._sign * (away - self._radius), self._sign * outwards
