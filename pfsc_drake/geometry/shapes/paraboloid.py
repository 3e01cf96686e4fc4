"""Paraboloids of revolution."""

import dataclasses as dc
import math
from collections.abc import Sequence
from typing import Annotated

import casadi as ca
from numpy.typing import ArrayLike

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.regions.region import Region, Symbol
from pfsc_drake.geometry.shapes.plane import OverRectangle, graph
from pfsc_drake.geometry.shapes.revolution import Meridian, TurnedRegion
from pfsc_drake.geometry.shapes.shape import Pair, ShapeInputs, SurfaceResult
from pfsc_drake.geometry.surfaces.product import ProductSurface
from pfsc_drake.yaml.rules import Range

_MOST_BENT = 1e4  # 1/m
# A bound, safe from rounding errors.
_ABOVE = 1.0 + 1e-15
# Newton's steps to the closest point of a paraboloid, from 1e-12 to 1e12 in p and q.
_STEPS = 8


@dc.dataclass
class Paraboloid(OverRectangle):
    """A paraboloid of revolution (4.53), (4.54) about its third axis, as a graph.

    Attributes:
        coefficient: Coefficient of ``theta_1^2 + theta_2^2`` in its height [1/m].
    """

    coefficient: Annotated[float, Range(-_MOST_BENT, _MOST_BENT, "1/m")] = 1.0

    def surface(self, inputs: ShapeInputs) -> SurfaceResult:
        """Return the surface, whatever its class."""
        return SurfaceResult(paraboloid(self.size, self.coefficient, self.origin, self.rotation))

    def region(self, inputs: ShapeInputs, *, inside: bool) -> Region:
        """Return the region that it bounds."""
        return ParaboloidRegion(self.coefficient, self.origin, self.axis, inside=inside)


def paraboloid(
    size: Sequence[float | Pair],
    coefficient: Annotated[float, Range(-_MOST_BENT, _MOST_BENT, "1/m")],
    origin: ArrayLike = (0.0, 0.0, 0.0),
    rotation: ArrayLike | None = None,
) -> ProductSurface:
    """Return a paraboloid of revolution as a graph, (4.53), (4.54).

    sigma = o + theta_1 e_x + theta_2 e_y + c (theta_1^2 + theta_2^2) e_z; the normal points
    along e_z at the vertex, where the radius of curvature is 1 / (2 c).

    Args:
        size: Largest theta_1 and theta_2, from zero, m; or first and last of each.
        coefficient: c, 1/m.
        origin: Vertex o, [3], m.
        rotation: Columns e, [3, 3]; the identity by default.

    Raises:
        InputError: An invalid size, coefficient or placement.
    """
    if not math.isfinite(coefficient):
        raise InputError(f"paraboloid coefficient: {coefficient}; a finite number is required")
    return graph(size, coefficient, origin, rotation)


class ParaboloidRegion(TurnedRegion):
    """Region inside or outside an infinite paraboloid of revolution, (4.53).

    To bound it, add another region: a paraboloid on a plane extends below the plane, where nothing
    is admissible.

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
        """Return the distance in a half-plane that ends at the axis.

        The closest point is at the largest root of a cubic, ``u^3 + p u = q`` with u = c times its
        radius. Newton's method decreases monotonically to it from above, and stops there.
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
