"""Surfaces fitted to points of a scanned workpiece."""

import dataclasses as dc
from typing import Annotated, Literal, cast

import numpy as np

from pfsc_drake.checks import FARTHEST, require
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.files.number_table import UNITS, Unit
from pfsc_drake.geometry.regions.region import Region
from pfsc_drake.geometry.regions.surface_region import SurfaceRegion, normal_points_outwards
from pfsc_drake.geometry.shapes.shape import (
    PlacedSurface,
    ShapeInputs,
    Smoothness,
    SurfaceResult,
)
from pfsc_drake.geometry.surfaces.choose_base import Axis, BaseChoice
from pfsc_drake.geometry.surfaces.grid import smooth_surface_near_grid, surface_through_grid
from pfsc_drake.geometry.surfaces.parametric_surface import Surface
from pfsc_drake.geometry.surfaces.point_file import read_surface_file
from pfsc_drake.geometry.surfaces.scattered import ScatteredFitOptions, fit_scattered
from pfsc_drake.geometry.surfaces.sheets import check_single_sheet
from pfsc_drake.yaml.fields import FILE, former
from pfsc_drake.yaml.rules import Count, MaybeDirection, MaybePoint, OneOf, Range

_BASES = ("auto", "plane", "cylinder")
_SHORTEST_TOLERANCE = 1e-7  # m
_Tolerance = Annotated[float, Range(_SHORTEST_TOLERANCE, FARTHEST, "m", besides=0.0)]
_OfGrid = Annotated[list[bool], Count(2, 2, words="two of true and false")]
# radius of a hole, relative to the distance of points
_HOLE = 2.0
# distance of neighbours across an unrecognized end of a row, relative to the others
_JUMP = 3.0


@dc.dataclass
class Fitted(PlacedSurface):
    """A surface fitted to points of a scanned workpiece; its placement applies to the file's axes.

    Attributes:
        file: CSV file with columns ``x, y, z``, or vertices of an STL, OBJ or PLY file; relative
            to the scenario's folder.
        unit: Unit of its numbers: ``m``, ``cm``, ``mm``, ``inch``.
        grid: ``[rows, columns]`` of points in the order of rows, theta_1 increasing from row to
            row; empty for scattered points.
        closed: Whether a grid closes from its last row, or column, to the first.
        tolerance: The smoothest surface that misses no point by more than this [m]; zero for the
            surface that predicts left-out points best.
        interpolate: Whether the surface goes through all points, of a grid without noise.
        smoothness: Class C^k; 0 chooses the class that the law needs.
        base: Surface over which scattered points are heights: ``auto``, ``plane``, ``cylinder``.
        base_axis: Axis of that cylinder; empty to estimate it.
        base_point: A point on that axis [m].
        visible_from: A point on the side that the normal points to, world axes [m]; empty for
            upwards on a plane, outward on a cylinder.
        along: Direction that theta_1 leans to on a plane, world axes; empty for the longer side.
        largest_hole: Largest distance on the surface to the nearest scattered point [m]; zero for
            four times the distance of points.
        trim: Whether to use the largest part that has no larger hole, instead of refusing.
    """

    file: str = dc.field(default="", metadata=FILE)
    unit: Annotated[str, OneOf(tuple(UNITS))] = "m"
    grid: list[int] = dc.field(default_factory=list)
    closed: _OfGrid = dc.field(default_factory=lambda: [False, False])
    tolerance: _Tolerance = 0.0
    interpolate: bool = False
    smoothness: Smoothness = 0
    base: Annotated[str, OneOf(_BASES)] = "auto"
    base_axis: MaybeDirection = dc.field(default_factory=list)
    base_point: MaybePoint = dc.field(default_factory=lambda: [0.0, 0.0, 0.0])
    visible_from: MaybePoint = dc.field(default_factory=list, metadata=former("seen_from"))
    along: MaybeDirection = dc.field(default_factory=list)
    largest_hole: _Tolerance = 0.0
    trim: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        good = len(self.grid) in (0, 2) and min(self.grid, default=2) >= 2
        require(good, "grid", self.grid, "empty, or [rows, columns] of two or more each")
        self._require_of_grids()
        if self.base_axis:
            require(self.base == "cylinder", "base", self.base, "cylinder, with base_axis")

    def _require_of_grids(self) -> None:
        """Refuse options that do not apply to the kind of points."""
        if self.grid:
            scattered = {"base": self.base != "auto", "visible_from": bool(self.visible_from)}
            scattered |= {
                "along": bool(self.along),
                "largest_hole": self.largest_hole > 0.0,
                "trim": self.trim,
            }
            for key, is_set in scattered.items():
                allowed = "for scattered points alone; leave out it or grid"
                require(not is_set, key, getattr(self, key), allowed)
            both = self.interpolate and self.tolerance > 0.0
            require(not both, "tolerance", self.tolerance, "0 with interpolate: true")
        else:
            allowed = "of a grid alone; write grid: [rows, columns]"
            require(not self.interpolate, "interpolate", self.interpolate, allowed)
            require(not any(self.closed), "closed", self.closed, allowed)

    @property
    def encloses(self) -> bool:
        """Whether it has an inside."""
        return all(self.closed)

    def surface(self, inputs: ShapeInputs) -> SurfaceResult:
        """Return the surface, whatever its class."""
        tell = inputs.progress or (lambda _fraction, _phase: None)
        file = inputs.file(self.file)
        tell(0.0, f"reading {file.name}")
        points, notes = read_surface_file(file, cast(Unit, self.unit))
        placed = points @ self.rotation.T + self.origin
        tell(0.0, f"fitting a surface to {len(points)} points")
        fitted = self._fit_grid if self.grid else self._fit_scattered
        found = fitted(placed, self.smoothness or inputs.smoothness)
        return dc.replace(found, notes=(*notes, *found.notes))

    def region(self, inputs: ShapeInputs, *, inside: bool) -> Region:
        """Return the region that it bounds."""
        surface = self.surface(inputs).surface
        check_single_sheet(surface)
        above_is_inside = self.encloses and not normal_points_outwards(surface)
        return SurfaceRegion(surface, above=inside == above_is_inside)

    def _fit_grid(self, points: np.ndarray, smoothness: int) -> SurfaceResult:
        rows, columns = self.grid
        if rows * columns != len(points):
            raise InputError(
                f"grid = {self.grid}: {rows * columns} points, and {self.file} has {len(points)}; "
                "rows times columns must be all of its points"
            )
        table, closed = points.reshape(rows, columns, 3), (self.closed[0], self.closed[1])
        self._refuse_swapped(points)
        if self.interpolate:
            return SurfaceResult(surface_through_grid(table, smoothness=smoothness, closed=closed))
        tolerance = self.tolerance or None
        return SurfaceResult(
            *smooth_surface_near_grid(
                table, smoothness=smoothness, tolerance=tolerance, closed=closed
            )
        )

    def _refuse_swapped(self, points: np.ndarray) -> None:
        """Refuse a grid whose rows jump, while rows of the swapped one do not."""
        rows, columns = self.grid

        def widest(count: int) -> float:
            steps = np.diff(points.reshape(-1, count, 3), axis=1)
            return float(np.linalg.norm(steps, axis=2).max())

        if widest(columns) > _JUMP * widest(rows):
            raise InputError(
                f"grid = {self.grid}: neighbours in a row are up to {widest(columns):.3g} m apart, "
                f"with [{columns}, {rows}] {widest(rows):.3g} m: rows and columns are swapped; "
                "must be [rows, columns] of points that are given row by row"
            )

    def _fit_scattered(self, points: np.ndarray, smoothness: int) -> SurfaceResult:
        base: BaseChoice = cast(Literal["auto", "plane", "cylinder"], self.base)
        if self.base_axis:
            base = Axis(self.base_point, self.base_axis)
        options = ScatteredFitOptions(
            smoothness=smoothness,
            tolerance=self.tolerance or None,
            base=base,
            visible_from=self.visible_from or None,
            along=self.along or None,
            largest_hole=self.largest_hole or None,
            trim=self.trim,
        )
        fit = fit_scattered(points, options)
        notes: tuple[str, ...] = ()
        if not self.visible_from:
            normal = ", ".join(f"{value:.3g}" for value in _normal_in_the_middle(fit.surface))
            notes = (
                f"{self.file}: the normal of the surface points to [{normal}] in its middle, as "
                "no visible_from says which side it is (upwards from a plane, outwards from a "
                "cylinder)",
            )
        if fit.hole > _HOLE * fit.spacing:
            centre = ", ".join(f"{value:.4g}" for value in fit.hole_at)
            notes += (
                f"{self.file}: no point within {1e3 * fit.hole:.3g} mm of [{centre}] m, others are "
                f"{1e3 * fit.spacing:.3g} mm apart: the surface bridges that hole; "
                "largest_hole (m) refuses it",
            )
        return SurfaceResult(fit.surface, fit.residuals, notes)


def _normal_in_the_middle(surface: Surface) -> np.ndarray:
    """Return the unit normal (4.3) at the middle of the domain, shape (3,)."""
    middle = [sum(ends) / 2.0 for ends in surface.domain]
    first, second = surface.partials(middle, 1)[1:3]
    normal = np.cross(first, second)
    return np.asarray(np.round(normal / np.linalg.norm(normal), 3) + 0.0)
