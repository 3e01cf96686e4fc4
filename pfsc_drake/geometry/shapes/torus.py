"""Tori."""

import dataclasses as dc
import math

import casadi as ca
from numpy.typing import ArrayLike

from pfsc_drake.checks import require
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.fourier_curve import FourierCurve
from pfsc_drake.geometry.regions.region import (
    Region,
    Symbol,
    checked_length,
    direction,
)
from pfsc_drake.geometry.shapes.revolution import (
    Meridian,
    OfRevolution,
    Turned,
    TurnedRegion,
    check_positive,
    surface_of_revolution,
)
from pfsc_drake.geometry.shapes.shape import Pair, ShapeInputs, SurfaceResult
from pfsc_drake.geometry.surfaces.product import ProductSurface
from pfsc_drake.yaml.rules import Length


@dc.dataclass
class Torus(OfRevolution):
    """A torus; theta_2 is the angle about its tube.

    Attributes:
        ring_radius: Distance from its axis to the middle of the tube [m].
        tube_radius: [m].
    """

    ring_radius: Length = 0.3
    tube_radius: Length = 0.1

    def __post_init__(self) -> None:
        super().__post_init__()
        allowed = f"more than tube_radius = {self.tube_radius:g} m"
        require(self.ring_radius > self.tube_radius, "ring_radius", self.ring_radius, allowed)

    def surface(self, inputs: ShapeInputs) -> SurfaceResult:
        """Return the surface, whatever its class."""
        return SurfaceResult(torus(self.ring_radius, self.tube_radius, self.turned))

    def region(self, inputs: ShapeInputs, *, inside: bool) -> Region:
        """Return the region that it bounds."""
        return TorusRegion(
            self.ring_radius, self.tube_radius, self.origin, self.axis, inside=inside
        )


def torus(
    ring_radius: Length,
    tube_radius: Length,
    turned: Turned | None = None,
    part: Pair | None = None,
) -> ProductSurface:
    """Return a torus; theta_1 is the angle about the axis, theta_2 about the tube, rad.

    Args:
        ring_radius: Distance from the axis to the middle of the tube, m.
        tube_radius: m, positive and smaller.
        turned: Placement, angles and side.
        part: First and last theta_2; closed by default.

    Raises:
        InputError: Numbers that are no torus.
    """
    check_positive("torus tube_radius", tube_radius)
    if not tube_radius < ring_radius < math.inf:
        raise InputError(
            f"torus ring_radius: {ring_radius} m; more than tube_radius = {tube_radius} m is"
            " required"
        )
    profile = FourierCurve.circle((ring_radius, 0.0), tube_radius, (1.0, 0.0), (0.0, 1.0))
    return surface_of_revolution(profile, part=part, **(turned or Turned())._asdict())


class TorusRegion(TurnedRegion):
    """Region inside or outside the tube of a torus.

    Args:
        ring_radius: Distance from the axis to the middle of the tube, m.
        tube_radius: m, positive and smaller.
        origin: Point on the axis, [3], m.
        axis: Vector along the axis, of any length, [3].
        inside: Whether the tube's inside is admissible, not the space around it.

    Raises:
        InputError: Numbers that are no torus.
    """

    def __init__(
        self,
        ring_radius: Length,
        tube_radius: Length,
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
        """Return the distance in a half-plane that ends at the axis."""
        away, n = direction(ca.vertcat(rho - self._ring, height), (1.0, 0.0))
        return away - self._tube, n[0], n[1]
