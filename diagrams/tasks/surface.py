"""Surfaces of a scenario: from shapes and from files."""

from dataclasses import dataclass, replace
from pathlib import Path as FilePath
from typing import Any, Literal, cast

import numpy as np

from diagrams.scenario import OrientationParameters, SurfaceParameters
from diagrams.scenario.surface import (
    Extruded,
    FileShape,
    Fitted,
    NumberShape,
    Revolved,
    SurfaceOrientationParameters,
    SurfaceShape,
)
from diagrams.scenario.surface_shapes import Cone, Cylinder, Paraboloid, Plane, Sphere, Torus
from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.control.manifolds.manifold import Manifold
from pfsc_drake.control.manifolds.surface import SurfaceManifold
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    quaternion_to_matrix,
    rotation_to_axis,
)
from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve
from pfsc_drake.geometry.curves.spline import interpolate
from pfsc_drake.geometry.files.unit import Unit
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.geometry.rotation import EULER_TO_QUATERNION
from pfsc_drake.geometry.surfaces.choose_base import Axis, BaseChoice
from pfsc_drake.geometry.surfaces.generated import extruded_surface, surface_of_revolution
from pfsc_drake.geometry.surfaces.grid import smooth_surface_near_grid, surface_through_grid
from pfsc_drake.geometry.surfaces.penalized_surface import Residuals
from pfsc_drake.geometry.surfaces.point_file import read_profile, read_surface_file
from pfsc_drake.geometry.surfaces.scattered import ScatteredFitOptions, fit_scattered
from pfsc_drake.geometry.surfaces.shapes import (
    Pair,
    Turned,
    cone,
    cylinder,
    paraboloid,
    plane,
    sphere,
    torus,
)
from pfsc_drake.geometry.surfaces.sheets import check_single_sheet
from pfsc_drake.geometry.surfaces.surface import Surface


@dataclass(frozen=True)
class MadeSurface:
    """A surface, and how far points are from it if it was fitted to some.

    Attributes:
        surface: The surface.
        fit: Where the points stand, or None.
        notes: Sentences on what of a file was ignored.
    """

    surface: Surface
    fit: Residuals | None = None
    notes: tuple[str, ...] = ()


def make_surface(
    shape: SurfaceShape, law: str, folder: FilePath, progress: Progress | None = None
) -> MadeSurface:
    """Return a surface, smooth enough for the law and a single sheet.

    Args:
        shape: What the scenario says.
        law: Key of ``RELATIVE_DEGREE``, r; decides the class C^(r+1) that is needed.
        folder: Where relative file names start.
        progress: Told the fraction done and what is done, where that takes its time.

    Raises:
        InputError: If the surface cannot be made, or is not smooth enough.
    """
    needed = RELATIVE_DEGREE[law] + 1
    made = surface_from_shape(shape, needed, folder, progress)
    if made.surface.smoothness < needed:
        raise InputError(
            f"smoothness: class C^{made.surface.smoothness:g}, and the law '{law}' needs "
            f"C^{needed}; write smoothness: 0 for what the law needs"
        )
    check_single_sheet(made.surface)
    return made


def surface_from_shape(
    shape: SurfaceShape, smoothness: int, folder: FilePath, progress: Progress | None = None
) -> MadeSurface:
    """Return a surface, whatever its class.

    Args:
        shape: What the scenario says.
        smoothness: k of the class C^k that one from a file gets, unless the scenario says another.
        folder: Where relative file names start.
        progress: Told how far it is.

    Raises:
        InputError: If the surface cannot be made.
    """
    if isinstance(shape, Fitted | Revolved | Extruded):
        return surface_from_file(shape, smoothness, folder, progress)
    return MadeSurface(_from_numbers(shape))


def _from_numbers(shape: NumberShape) -> Surface:
    rotation = shape.rotation
    if isinstance(shape, Plane | Paraboloid):
        size = (_pair(shape.first), _pair(shape.second))
        if isinstance(shape, Plane):
            return plane(size, shape.origin, rotation)
        return paraboloid(size, shape.coefficient, shape.origin, rotation)
    angles = _pair(np.deg2rad(shape.angles_deg)) if shape.angles_deg else None
    turned = Turned(shape.origin, rotation, angles, shape.inward)
    if isinstance(shape, Cylinder):
        return cylinder(shape.radius, _pair(shape.heights), turned)
    if isinstance(shape, Cone):
        return cone(float(np.deg2rad(shape.opening_deg)), _pair(shape.distances), turned)
    if isinstance(shape, Sphere):
        return sphere(shape.radius, _pair(np.deg2rad(shape.latitudes_deg)), turned)
    assert isinstance(shape, Torus)
    return torus(shape.ring_radius, shape.tube_radius, turned)


def given_quaternion(orientation: SurfaceOrientationParameters) -> np.ndarray | None:
    """Return the quaternion of an orientation that is the same everywhere, or None."""
    if orientation.kind != "given":
        return None
    return EULER_TO_QUATERNION[orientation.convention](np.deg2rad([orientation.angles_deg]))[0]


def normal_offset(orientation: SurfaceOrientationParameters) -> np.ndarray:
    """Return the rotation of the tool away from the surface's frame, shape (3, 3)."""
    turn = EULER_TO_QUATERNION[orientation.convention](np.deg2rad([orientation.angles_deg]))[0]
    return quaternion_to_matrix(turn)


def make_surface_manifold(order: int, parameters: SurfaceParameters) -> SurfaceManifold:
    """Return the manifold of a surface with its orientation.

    Args:
        order: Relative degree of the law.
        parameters: What the scenario says.

    Raises:
        InputError: If the law has no such order.
    """
    said = parameters.orientation
    kind = None if said.kind == "none" else cast(Literal["given", "normal"], said.kind)
    offset = normal_offset(said) if kind == "normal" else None
    return SurfaceManifold(order, orientation=kind, offset=offset, **followed_angles(said))


def followed_angles(
    orientation: OrientationParameters | SurfaceOrientationParameters,
) -> dict[str, Any]:
    """Return the axis of the tool, or that in the world, that alone follows, or whose angles do.

    Args:
        orientation: What the scenario says.

    Returns:
        ``tool_axis`` and ``yaw_axis``, each of shape (3,) and length one, or None; ``euler``, the
        convention of Euler angles whose differences are the coordinates, or None.
    """
    none = isinstance(orientation, SurfaceOrientationParameters) and orientation.kind == "none"
    task = "none" if none else orientation.task
    axes = {"tool_axis": orientation.tool_axis, "yaw_axis": orientation.yaw_axis}
    chosen = {"tool_axis": "tool_axis", "yaw": "yaw_axis"}.get(task)
    euler = orientation.convention if orientation.jacobian == "analytic" else None
    return {"euler": euler} | {
        name: rotation_to_axis(axis)[:, 0] if name == chosen else None
        for name, axis in axes.items()
    }


def require_joints(manifold: Manifold, num_joints: int) -> None:
    """Refuse a robot with fewer joints than a surface, or a path on it, has coordinates.

    Args:
        manifold: The manifold.
        num_joints: Number of joints of the robot.

    Raises:
        InputError: If it has.
    """
    names = [coordinate.name for coordinate in manifold.coordinates]
    if num_joints < len(names):
        raise InputError(
            f"surface: {num_joints} joints for {len(names)} outputs ({', '.join(names)}); "
            "surface.orientation.task: tool_axis needs 5, yaw 4, kind: none 3"
        )


def _pair(values: object) -> Pair:
    first, last = np.asarray(values, dtype=float)
    return float(first), float(last)


# times the distance of points, from which on a place without any is a hole
_HOLE = 2.0
# how many times further apart neighbours are where a row ends unseen
_JUMP = 3.0


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
        points, notes = read_surface_file(file, cast(Unit, shape.unit))
        placed = points @ shape.rotation.T + shape.origin
        tell(0.0, f"fitting a surface to {len(points)} points")
        fitted = _near_grid if shape.grid else _scattered
        found = fitted(shape, placed, made)
        return replace(found, notes=(*notes, *found.notes))
    rotation = shape.rotation
    profile, notes = profile_from_file(shape, smoothness, folder)
    if isinstance(shape, Revolved):
        first, last = np.deg2rad(shape.angles_deg) if shape.angles_deg else (0.0, 0.0)
        return MadeSurface(
            surface_of_revolution(
                profile,
                origin=shape.origin,
                rotation=rotation,
                angles=(float(first), float(last)) if shape.angles_deg else None,
                inward=shape.inward,
            ),
            notes=notes,
        )
    extruded = extruded_surface(profile, rotation @ shape.direction, shape.length)
    return MadeSurface(extruded, notes=notes)


def profile_from_file(
    shape: Revolved | Extruded, smoothness: int, folder: FilePath
) -> tuple[PiecewisePolynomialCurve, tuple[str, ...]]:
    """Return the profile that a surface is made from, and what of its file was ignored.

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
        points, notes = read_profile(file, ["radius", "height"])
        if not points[:, 0].min() > 0.0:
            raise InputError(
                f"{shape.file}: radius = {points[:, 0].min():g} m; positive numbers are required, "
                "since a profile must not meet the axis"
            )
    else:
        rotation = shape.rotation
        points, notes = read_profile(file, ["x", "y", "z"])
        points = points @ rotation.T + shape.origin
    try:
        degree = shape.smoothness or smoothness
        return interpolate(points, smoothness=degree, closed=shape.closed), notes
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


def _normal_in_the_middle(surface: Surface) -> np.ndarray:
    """Return the unit normal (4.3) at the middle of the domain, shape (3,)."""
    middle = [sum(ends) / 2.0 for ends in surface.domain]
    first, second = surface.partials(middle, 1)[1:3]
    normal = np.cross(first, second)
    return np.asarray(np.round(normal / np.linalg.norm(normal), 3) + 0.0)


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
    notes: tuple[str, ...] = ()
    if not shape.seen_from:
        normal = ", ".join(f"{value:.3g}" for value in _normal_in_the_middle(fit.surface))
        notes = (
            f"{shape.file}: the normal of the surface points to [{normal}] in its middle, as no "
            "seen_from says which side it is (upwards from a plane, outwards from a cylinder)",
        )
    if fit.hole > _HOLE * fit.spacing:
        place = ", ".join(f"{value:.4g}" for value in fit.hole_at)
        notes += (
            f"{shape.file}: no point within {1e3 * fit.hole:.3g} mm of [{place}] m, others are "
            f"{1e3 * fit.spacing:.3g} mm apart: the surface bridges that hole; largest_hole (m) "
            "refuses it",
        )
    return MadeSurface(fit.surface, fit.residuals, notes)
