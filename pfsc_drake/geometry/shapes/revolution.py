"""Surfaces of revolution."""

import dataclasses as dc
import math
from abc import abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.checks import require, require_numbers
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve
from pfsc_drake.geometry.regions.region import (
    FormulaRegion,
    Symbol,
    axes_along,
    checked_point,
    direction,
)
from pfsc_drake.geometry.shapes.shape import Pair, PlacedSurface, pair
from pfsc_drake.geometry.surfaces.basis import TrigonometricBasis, curve_on_basis
from pfsc_drake.geometry.surfaces.parametric_surface import checked_placement
from pfsc_drake.geometry.surfaces.product import ProductSurface
from pfsc_drake.geometry.surfaces.regularity import check_regular

_LARGEST_TURN = 720.0  # deg
_TURN = 2.0 * math.pi


class Turned(NamedTuple):
    """Common parameters of all surfaces of revolution.

    Attributes:
        origin: Point on the axis, [3], m.
        rotation: Its third column is the axis, its first the direction theta_1 = 0, [3, 3];
            the identity by default.
        angles: First and last theta_1, rad; a closed turn by default.
        inward: Whether the normal points inwards; theta_1 then runs in the opposite sense.
    """

    origin: ArrayLike = (0.0, 0.0, 0.0)
    rotation: ArrayLike | None = None
    angles: Pair | None = None
    inward: bool = False


@dc.dataclass
class OfRevolution(PlacedSurface):
    """A surface of revolution; theta_1 is the angle about its axis.

    Attributes:
        angles_deg: First and last theta_1 [deg]; empty for a whole turn, which is closed.
        inward: Whether the normal points to the axis.
    """

    angles_deg: list[float] = dc.field(default_factory=list)
    inward: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.angles_deg:
            require_numbers("angles_deg", self.angles_deg, 2)
            first, last = self.angles_deg
            good = -_LARGEST_TURN <= first < last <= _LARGEST_TURN
            allowed = f"two numbers that increase, of at most {_LARGEST_TURN:g} deg"
            require(good, "angles_deg", self.angles_deg, allowed)

    @property
    def turned(self) -> Turned:
        """Placement, angles [rad] and side.

        Raises:
            InputError: If ``start`` is along ``axis``.
        """
        angles = pair(np.deg2rad(self.angles_deg)) if self.angles_deg else None
        return Turned(self.origin, self.rotation, angles, self.inward)

    def check_side(self, admissible: str) -> None:
        """Refuse an admissible side that its region does not have."""
        super().check_side(admissible)
        allowed = "empty: a region goes all the way round"
        require(not self.angles_deg, "shape.angles_deg", self.angles_deg, allowed)


def surface_of_revolution(
    profile: Curve,
    *,
    part: tuple[float, float] | None = None,
    origin: ArrayLike = (0.0, 0.0, 0.0),
    rotation: ArrayLike | None = None,
    angles: tuple[float, float] | None = None,
    inward: bool = False,
) -> ProductSurface:
    """Return the surface swept by a profile that is turned about an axis.

    sigma = o + rho(theta_2) (e_x cos(theta_1) + e_y sin(theta_1)) + h(theta_2) e_z, with the
    columns e of the rotation. Where h grows with theta_2 the normal (4.3) points away from the
    axis.

    Args:
        profile: (rho, h), a curve in the plane, m.
        part: Parameters of the profile that are used, of a Fourier curve; all by default.
        origin: o, [3], m.
        rotation: [3, 3]; the identity by default.
        angles: First and last theta_1, rad; closed by default.
        inward: Turn in the opposite sense, -e_y instead of e_y, which inverts the normal.

    Raises:
        InputError: A profile of another dimension, one that meets the axis or is not
            regular, or angles that do not increase or exceed a turn.
    """
    if profile.dimension != 2:
        raise InputError(f"profile: dimension {profile.dimension}; (radius, height) is required")
    begin, end = angles or (0.0, _TURN)
    if not 0.0 < end - begin <= _TURN * (1.0 + 1e-12):
        raise InputError(
            f"angles: [{begin:.9g}, {end:.9g}] rad; must increase, by at most {_TURN:.9g}"
        )
    o, R = checked_placement(origin, rotation)
    second, table = curve_on_basis(profile, part)
    coefficients = np.zeros((1, len(table), 3, second.size, 3))
    rho, height = table[..., 0, None], table[..., 1, None]
    coefficients[0, :, 0] = height * R[:, 2]
    coefficients[0, :, 0, 0] += o
    coefficients[0, :, 1] = rho * R[:, 0]
    coefficients[0, :, 2] = rho * (-R[:, 1] if inward else R[:, 1])
    first = TrigonometricBasis((begin, end), 1, closed=angles is None)
    surface = ProductSurface(first, second, coefficients, smoothness=profile.smoothness)
    check_regular(surface)
    return surface


def turned_line(start: Pair, slope: Pair, ends: Pair, turned: Turned | None) -> ProductSurface:
    """Return the surface of revolution of the line start + theta_2 slope."""
    begin, end = checked_ends("theta_2", ends)
    table = np.array([[np.add(start, np.multiply(slope, begin)), slope]])
    profile = PiecewisePolynomialCurve([begin, end], table)
    return surface_of_revolution(profile, **(turned or Turned())._asdict())


def checked_ends(name: str, ends: Sequence[float]) -> Pair:
    """Return first and last value of a parameter as floats.

    Raises:
        InputError: If they are not finite or do not increase.
    """
    begin, end = ends
    if not (math.isfinite(begin) and math.isfinite(end) and begin < end):
        raise InputError(
            f"{name}: from {begin} to {end}; finite numbers that increase are required"
        )
    return float(begin), float(end)


def check_positive(name: str, value: float) -> None:
    """Refuse values that are not positive lengths [m]."""
    if not 0.0 < value < math.inf:
        raise InputError(f"{name}: {value} m; a positive number of metres is required")


Meridian = tuple[Symbol, Symbol, Symbol]


class TurnedRegion(FormulaRegion):
    """Region inside or outside a surface of revolution.

    Args:
        origin: Point on the axis, [3], m.
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
        """Return the distance in a half-plane that ends at the axis.

        Args:
            rho: Distance from the axis, m.
            height: Height along the axis from the origin, m.

        Returns:
            Distance of the meridian curve, positive outside, m, and its derivatives with respect to
            rho and the height.
        """

    def formula(self, point: Symbol) -> tuple[Symbol, Symbol]:
        """Return the signed distance and normal as expressions."""
        local = self._axes @ (point - self._origin)
        rho, outwards = direction(local[:2], (1.0, 0.0))
        h, radial, axial = self.meridian(rho, local[2])
        return self._sign * h, self._sign * (self._axes.T @ ca.vertcat(radial * outwards, axial))
