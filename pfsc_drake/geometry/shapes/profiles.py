"""Profiles from files, turned about an axis or extruded."""

import dataclasses as dc
from abc import abstractmethod
from pathlib import Path

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve
from pfsc_drake.geometry.curves.spline import interpolate
from pfsc_drake.geometry.regions.plane_curve import PlaneCurve
from pfsc_drake.geometry.regions.region import FormulaRegion, Region, Symbol, axes_along
from pfsc_drake.geometry.shapes.revolution import (
    Meridian,
    OfRevolution,
    TurnedRegion,
    surface_of_revolution,
)
from pfsc_drake.geometry.shapes.shape import (
    PlacedSurface,
    ShapeInputs,
    Smoothness,
    SurfaceResult,
)
from pfsc_drake.geometry.surfaces.point_file import read_profile
from pfsc_drake.geometry.surfaces.product import extruded_surface
from pfsc_drake.geometry.surfaces.sheets import check_single_sheet
from pfsc_drake.yaml.fields import FILE
from pfsc_drake.yaml.rules import Direction, Length

Profile = tuple[PiecewisePolynomialCurve, tuple[str, ...]]


class FromProfile(PlacedSurface):
    """Surface swept by a profile, and the region that it bounds.

    Attributes:
        file: CSV file of the profile.
        closed: Whether the profile closes from the last point to the first.
        smoothness: Class C^k of the spline through it; 0 chooses the class that the law needs.
    """

    file: str
    closed: bool
    smoothness: Smoothness

    @property
    def encloses(self) -> bool:
        """Whether it has an inside."""
        return self.closed

    @abstractmethod
    def points(self, file: Path) -> tuple[np.ndarray, tuple[str, ...]]:
        """Return the points of the profile, and notes on ignored parts of its file.

        Raises:
            InputError: If the file cannot be used.
        """

    @abstractmethod
    def bounded_region(self, profile: PiecewisePolynomialCurve, *, inside: bool) -> Region:
        """Return the region that the surface of a profile bounds.

        Raises:
            InputError: If it bounds none.
        """

    def profile(self, inputs: ShapeInputs) -> Profile:
        """Return the profile, and notes on ignored parts of its file.

        Args:
            inputs: Folder of its file, and class of the spline.

        Raises:
            InputError: If the file cannot be used.
        """
        points, notes = self.points(inputs.file(self.file))
        try:
            degree = self.smoothness or inputs.smoothness
            return interpolate(points, smoothness=degree, closed=self.closed), notes
        except InputError as error:
            raise InputError(f"{self.file}: {error}") from None

    def region(self, inputs: ShapeInputs, *, inside: bool) -> Region:
        """Return the region that it bounds."""
        # the surface itself is made for its checks
        check_single_sheet(self.surface(inputs).surface)
        profile, _ = self.profile(inputs)
        try:
            return self.bounded_region(profile, inside=inside)
        except InputError as error:
            raise InputError(f"{self.file}: {error}") from None


@dc.dataclass
class Revolved(FromProfile, OfRevolution):
    """A surface that a profile leaves when it turns about the third axis; theta_1 is the angle.

    Attributes:
        file: CSV file with columns ``radius, height`` [m], points of the profile in order,
            which theta_2 runs along; relative to the scenario's folder.
        closed: Whether the profile closes from the last point to the first.
        smoothness: Class C^k of the spline through it; 0 chooses the class that the law needs.
    """

    file: str = dc.field(default="", metadata=FILE)
    closed: bool = False
    smoothness: Smoothness = 0

    def points(self, file: Path) -> tuple[np.ndarray, tuple[str, ...]]:
        """Return radius and height of the profile [m], dimension 2, and notes on ignored parts."""
        points, notes = read_profile(file, ["radius", "height"])
        if not points[:, 0].min() > 0.0:
            raise InputError(
                f"{self.file}: radius = {points[:, 0].min():g} m; positive numbers are required, "
                "since a profile must not meet the axis"
            )
        return points, notes

    def surface(self, inputs: ShapeInputs) -> SurfaceResult:
        """Return the surface, whatever its class."""
        turned = self.turned
        profile, notes = self.profile(inputs)
        return SurfaceResult(surface_of_revolution(profile, **turned._asdict()), notes=notes)

    def bounded_region(self, profile: PiecewisePolynomialCurve, *, inside: bool) -> Region:
        """Return the region that the surface of a profile bounds."""
        # of an open one inside is below, by its normal
        turned = self.inward and not self.closed
        return RevolvedRegion(profile, self.origin, self.axis, inside=inside != turned)


@dc.dataclass
class Extruded(FromProfile):
    """A surface that a profile leaves when it is moved along a line, which theta_2 runs along.

    Attributes:
        file: CSV file with columns ``x, y, z`` [m], points of the profile in order, which theta_1
            runs along; relative to the scenario's folder.
        direction: Direction of the line, in the file's axes, of any length.
        length: Length of the line [m].
        closed: Whether the profile closes from the last point to the first.
        smoothness: Class C^k of the spline through it; 0 chooses the class that the law needs.
    """

    file: str = dc.field(default="", metadata=FILE)
    direction: Direction = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])
    length: Length = 0.2
    closed: bool = False
    smoothness: Smoothness = 0

    def points(self, file: Path) -> tuple[np.ndarray, tuple[str, ...]]:
        """Return the profile in the world [m], dimension 3, and notes on ignored parts."""
        rotation = self.rotation
        points, notes = read_profile(file, ["x", "y", "z"])
        return points @ rotation.T + self.origin, notes

    def surface(self, inputs: ShapeInputs) -> SurfaceResult:
        """Return the surface, whatever its class."""
        rotation = self.rotation
        profile, notes = self.profile(inputs)
        surface = extruded_surface(profile, rotation @ self.direction, self.length)
        return SurfaceResult(surface, notes=notes)

    def bounded_region(self, profile: PiecewisePolynomialCurve, *, inside: bool) -> Region:
        """Return the region that the surface of a profile bounds."""
        return ExtrudedRegion(profile, self.rotation @ self.direction, inside=inside)


class ExtrudedRegion(FormulaRegion):
    """Region on one side of a profile that is extruded infinitely.

    Both ends of an open profile are extended straight.

    Args:
        profile: Curve in R^3 of class C^2, m.
        direction: Direction of the extrusion, of any length, [3].
        inside: Whether the inside of a closed profile is admissible; of an open one the side that
            the normal (4.3) of `extruded_surface` points away from.

    Raises:
        InputError: No such profile or direction, or an open profile whose extended ends meet it.
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
        """Return the signed distance and normal as expressions."""
        h, n = self._curve.signed_distance(self._axes @ point)
        return self._sign * h, self._sign * (self._axes.T @ n)


class RevolvedRegion(TurnedRegion):
    """Region on one side of a profile that is revolved about an axis.

    Both ends of an open profile are extended straight, to the axis or infinitely.

    Args:
        profile: (rho, h), a curve in the plane of class C^2, m, that does not meet the axis.
        origin: Point on the axis where h is zero, [3], m.
        axis: Axis of growing h, of any length, [3].
        inside: Whether the inside of a closed profile is admissible; of an open one the side that
            the normal (4.3) of `surface_of_revolution` points away from: the axis' side, where h
            grows along the profile.

    Raises:
        InputError: No such profile, point or direction, or an open profile whose extended ends
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
        """Return the distance in a half-plane that ends at the axis."""
        h, n = self._curve.signed_distance(ca.vertcat(rho, height))
        return h, n[0], n[1]


def _right_sign(curve: PlaneCurve, closed: bool, inside: bool) -> float:
    """Return the sign of the region to the right of a curve."""
    right_is_outside = curve.counter_clockwise or not closed
    return 1.0 if right_is_outside != inside else -1.0
