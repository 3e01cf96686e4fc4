"""Surfaces of a scenario that come from files."""

from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Literal, cast

import numpy as np

from diagrams.scenario.surface import FileShape
from diagrams.scenario.surface_files import Extruded, Fitted, Revolved
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve
from pfsc_drake.geometry.curves.spline import interpolate
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.geometry.surfaces.choose_base import Axis, BaseChoice
from pfsc_drake.geometry.surfaces.generated import extruded_surface, surface_of_revolution
from pfsc_drake.geometry.surfaces.grid import surface_through_grid
from pfsc_drake.geometry.surfaces.grid_smoothing import smooth_surface_near_grid
from pfsc_drake.geometry.surfaces.point_file import Unit, read_surface_points
from pfsc_drake.geometry.surfaces.profile_file import read_profile
from pfsc_drake.geometry.surfaces.residuals import Residuals
from pfsc_drake.geometry.surfaces.scattered import ScatteredFitOptions, fit_scattered
from pfsc_drake.geometry.surfaces.surface import Surface

# how many times further apart neighbours are where a row ends unseen
_JUMP = 3.0


@dataclass(frozen=True)
class MadeSurface:
    """A surface, and how far points are from it if it was fitted to some.

    Attributes:
        surface: The surface.
        fit: Where the points stand, or None.
    """

    surface: Surface
    fit: Residuals | None = None


def surface_from_file(
    shape: FileShape, smoothness: int, folder: FilePath, progress: Progress | None = None
) -> MadeSurface:
    """Return a surface that a file describes.

    Args:
        shape: What the scenario says.
        smoothness: k of the class C^k that it gets, unless the scenario says another.
        folder: Where relative file names start.
        progress: Told the fraction done and what is done.

    Raises:
        InputError: If the file cannot be used, or no surface be made of it.
    """
    tell = progress or (lambda _fraction, _phase: None)
    made = shape.smoothness or smoothness
    if isinstance(shape, Fitted):
        file = _file_of(shape, folder)
        tell(0.0, f"reading {file.name}")
        points = read_surface_points(file, cast(Unit, shape.unit))
        placed = points @ shape.rotation.T + shape.origin
        tell(0.0, f"fitting a surface to {len(points)} points")
        return _near_grid(shape, placed, made) if shape.grid else _scattered(shape, placed, made)
    rotation = shape.rotation
    profile = profile_from_file(shape, smoothness, folder)
    if isinstance(shape, Revolved):
        first, last = np.deg2rad(shape.angles_deg) if shape.angles_deg else (0.0, 0.0)
        return MadeSurface(
            surface_of_revolution(
                profile,
                origin=shape.origin,
                rotation=rotation,
                angles=(float(first), float(last)) if shape.angles_deg else None,
                inward=shape.inward,
            )
        )
    return MadeSurface(extruded_surface(profile, rotation @ shape.direction, shape.length))


def profile_from_file(
    shape: Revolved | Extruded, smoothness: int, folder: FilePath
) -> PiecewisePolynomialCurve:
    """Return the profile that a surface is made from.

    Args:
        shape: What the scenario says.
        smoothness: k of the class C^k that it gets, unless the scenario says another.
        folder: Where relative file names start.

    Returns:
        Radius and height of a surface of revolution [m], dimension 2; of an extruded one a curve
        in the world [m], dimension 3.

    Raises:
        InputError: If the file cannot be used.
    """
    file = _file_of(shape, folder)
    if isinstance(shape, Revolved):
        points = read_profile(file, ["radius", "height"])
        if not points[:, 0].min() > 0.0:
            raise InputError(
                f"{shape.file}: radius = {points[:, 0].min():g} m; positive numbers are required, "
                "since a profile must not meet the axis"
            )
    else:
        rotation = shape.rotation
        points = read_profile(file, ["x", "y", "z"]) @ rotation.T + shape.origin
    try:
        return interpolate(points, smoothness=shape.smoothness or smoothness, closed=shape.closed)
    except InputError as error:
        raise InputError(f"{shape.file}: {error}") from None


def _file_of(shape: FileShape, folder: FilePath) -> FilePath:
    if not shape.file:
        raise InputError("file: none; write file: NAME, relative to the scenario's folder")
    return folder / shape.file


def _near_grid(shape: Fitted, points: np.ndarray, smoothness: int) -> MadeSurface:
    rows, columns = shape.grid
    if rows * columns != len(points):
        raise InputError(
            f"grid = {shape.grid}: {rows * columns} points, and {shape.file} has {len(points)}; "
            "rows times columns must be all of its points"
        )
    table, closed = points.reshape(rows, columns, 3), (shape.closed[0], shape.closed[1])
    _refuse_swapped(shape, points)
    if shape.interpolate:
        return MadeSurface(surface_through_grid(table, smoothness=smoothness, closed=closed))
    tolerance = shape.tolerance or None
    return MadeSurface(
        *smooth_surface_near_grid(table, smoothness=smoothness, tolerance=tolerance, closed=closed)
    )


def _refuse_swapped(shape: Fitted, points: np.ndarray) -> None:
    """Refuse a grid whose rows jump, where those of the swapped one do not."""
    rows, columns = shape.grid

    def widest(count: int) -> float:
        steps = np.diff(points.reshape(-1, count, 3), axis=1)
        return float(np.linalg.norm(steps, axis=2).max())

    if widest(columns) > _JUMP * widest(rows):
        raise InputError(
            f"grid = {shape.grid}: neighbours in a row are up to {widest(columns):.3g} m apart, "
            f"with [{columns}, {rows}] {widest(rows):.3g} m: rows and columns are swapped; must "
            "be [rows, columns] of points that are given row by row"
        )


def _scattered(shape: Fitted, points: np.ndarray, smoothness: int) -> MadeSurface:
    base: BaseChoice = cast(Literal["auto", "plane", "cylinder"], shape.base)
    if shape.base_axis:
        base = Axis(shape.base_point, shape.base_axis)
    options = ScatteredFitOptions(
        smoothness=smoothness,
        tolerance=shape.tolerance or None,
        base=base,
        seen_from=shape.seen_from or None,
        along=shape.along or None,
        largest_hole=shape.largest_hole or None,
        trim=shape.trim,
    )
    fit = fit_scattered(points, options)
    return MadeSurface(fit.surface, fit.residuals)
