"""Regions bounded by profiles that go on for ever: extruded, or turned about an axis."""

import casadi as ca
from numpy.typing import ArrayLike

from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve
from pfsc_drake.geometry.regions.placement import axes_along
from pfsc_drake.geometry.regions.plane_curve import PlaneCurve
from pfsc_drake.geometry.regions.region import FormulaRegion, Symbol
from pfsc_drake.geometry.regions.shapes import Meridian, TurnedRegion


class ExtrudedRegion(FormulaRegion):
    """What lies on one side of a profile that is moved along a line without end.

    Both ends of an open profile go on straight.

    Args:
        profile: Curve in R^3 of class C^2, m.
        direction: Of the line, of any length, [3].
        inside: Whether what a closed profile encloses is admissible; of an open one the side that
            the normal (4.3) of `extruded_surface` points away from.

    Raises:
        InputError: No such profile or direction, or an open profile whose ends, going on, meet it.
    """

    symbol = ca.MX

    def __init__(
        self, profile: PiecewisePolynomialCurve, direction: ArrayLike, *, inside: bool
    ) -> None:
        axes = axes_along(direction)[:2]
        self._axes = ca.DM(axes)
        curve = PiecewisePolynomialCurve(
            profile.breakpoints,
            profile.coefficients @ axes.T,
            closed=profile.closed,
            known_smoothness=int(min(profile.smoothness, profile.degree)),
        )
        self._curve = PlaneCurve(curve)
        self._sign = _right_sign(self._curve, profile.closed, inside)

    def formula(self, point: Symbol) -> tuple[Symbol, Symbol]:
        """See the base class."""
        h, n = self._curve.signed_distance(self._axes @ point)
        return self._sign * h, self._sign * (self._axes.T @ n)


class RevolvedRegion(TurnedRegion):
    """What lies on one side of a profile that is turned about an axis.

    Both ends of an open profile go on straight, to the axis or without end.

    Args:
        profile: (rho, h), a curve in the plane of class C^2, m, that does not meet the axis.
        origin: On the axis, where h is zero, [3], m.
        axis: Of growing h, of any length, [3].
        inside: Whether what a closed profile encloses is admissible; of an open one the side that
            the normal (4.3) of `surface_of_revolution` points away from: that of the axis, where h
            grows along the profile.

    Raises:
        InputError: No such profile, point or direction, or an open profile whose ends, going on,
            meet it.
    """

    symbol = ca.MX

    def __init__(
        self,
        profile: PiecewisePolynomialCurve,
        origin: ArrayLike,
        axis: ArrayLike,
        *,
        inside: bool,
    ) -> None:
        super().__init__(origin, axis, inside=False)
        self._curve = PlaneCurve(profile, ends_at_axis=True)
        self._sign = _right_sign(self._curve, profile.closed, inside)

    def meridian(self, rho: Symbol, height: Symbol) -> Meridian:
        """See the base class."""
        h, n = self._curve.signed_distance(ca.vertcat(rho, height))
        return h, n[0], n[1]


def _right_sign(curve: PlaneCurve, closed: bool, inside: bool) -> float:
    """Sign of what is to the right of a curve."""
    right_is_outside = curve.counter_clockwise or not closed
    return 1.0 if right_is_outside != inside else -1.0
