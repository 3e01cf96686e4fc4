"""The regions of a scenario."""

import math
from pathlib import Path as FilePath

import numpy as np

from diagrams.scenario.region import (
    Box,
    RegionParameters,
    RegionShape,
    Shift,
    Turn,
    Visiting,
    encloses,
)
from diagrams.scenario.surface_files import Extruded, Fitted, Revolved
from diagrams.scenario.surface_shapes import Cone, Cylinder, Paraboloid, Sphere, Torus
from diagrams.tasks.surface import surface_from_shape
from diagrams.tasks.surface_files import profile_from_file
from pfsc_drake.control.law.reference import rest_to_rest
from pfsc_drake.control.law.swing import SwingingCourse
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.geometry.regions.course import Course, CurveCourse
from pfsc_drake.geometry.regions.moving import MovingRegion, ShiftedRegion, TurningRegion
from pfsc_drake.geometry.regions.polyhedron import PolyhedronRegion, box_corners
from pfsc_drake.geometry.regions.profile import ExtrudedRegion, RevolvedRegion
from pfsc_drake.geometry.regions.region import Region
from pfsc_drake.geometry.regions.shapes import (
    ConeRegion,
    CylinderRegion,
    HalfSpace,
    ParaboloidRegion,
    SphereRegion,
    TorusRegion,
)
from pfsc_drake.geometry.regions.surface_region import SurfaceRegion, normal_points_outwards
from pfsc_drake.geometry.surfaces.sheets import check_single_sheet

# Class C^k that a region's surface needs.
_SMOOTHNESS = 2


def make_region(
    parameters: RegionParameters, folder: FilePath, progress: Progress | None = None
) -> Region | MovingRegion:
    """Return a region, which moves if the scenario says so.

    Args:
        parameters: What the scenario says.
        folder: Where relative file names start.
        progress: Told the fraction done and what is done, where that takes its time.

    Raises:
        InputError: If a file cannot be used, or no region be made of it.
    """
    region = _region_at_rest(parameters.shape, parameters.inside, folder, progress)
    motion = parameters.motion
    if isinstance(motion, Shift):
        return ShiftedRegion(region, _course(motion, 1.0), motion.direction)
    if isinstance(motion, Turn):
        course = _course(motion, math.pi / 180.0)
        return TurningRegion(region, course, motion.point, motion.axis)
    return region


def _region_at_rest(
    shape: RegionShape, inside: bool, folder: FilePath, progress: Progress | None
) -> Region:
    if isinstance(shape, Fitted):
        return _fitted(shape, inside, folder, progress)
    if isinstance(shape, Revolved | Extruded):
        return _of_profile(shape, inside, folder)
    origin, axis = shape.origin, shape.axis
    if isinstance(shape, Box):
        return PolyhedronRegion(box_corners(shape.size, origin, shape.rotation))
    if isinstance(shape, Paraboloid):
        return ParaboloidRegion(shape.coefficient, origin, axis, inside=inside)
    if isinstance(shape, Cylinder):
        return CylinderRegion(shape.radius, origin, axis, inside=inside)
    if isinstance(shape, Cone):
        return ConeRegion(math.radians(shape.opening_deg), origin, axis, inside=inside)
    if isinstance(shape, Sphere):
        return SphereRegion(origin, shape.radius, inside=inside)
    if isinstance(shape, Torus):
        return TorusRegion(shape.ring_radius, shape.tube_radius, origin, axis, inside=inside)
    return HalfSpace(origin, np.negative(axis) if inside else axis)


def _fitted(
    shape: Fitted, inside: bool, folder: FilePath, progress: Progress | None
) -> SurfaceRegion:
    surface = surface_from_shape(shape, _SMOOTHNESS, folder, progress).surface
    check_single_sheet(surface)
    above_is_inside = encloses(shape) and not normal_points_outwards(surface)
    return SurfaceRegion(surface, above=inside == above_is_inside)


def _of_profile(
    shape: Revolved | Extruded, inside: bool, folder: FilePath
) -> RevolvedRegion | ExtrudedRegion:
    # the surface itself is made for its checks
    check_single_sheet(surface_from_shape(shape, _SMOOTHNESS, folder).surface)
    profile = profile_from_file(shape, _SMOOTHNESS, folder)
    try:
        if isinstance(shape, Revolved):
            # of an open one inside is below, by its normal
            turned = shape.inward and not shape.closed
            return RevolvedRegion(profile, shape.origin, shape.axis, inside=inside != turned)
        direction = shape.rotation @ shape.direction
        return ExtrudedRegion(profile, direction, inside=inside)
    except InputError as error:
        raise InputError(f"{shape.file}: {error}") from None


def _course(motion: Shift | Turn, unit: float) -> Course:
    """A course in m or rad, of a way in units."""
    way = motion.way
    if isinstance(way, Visiting):
        points = [unit * point for point in way.points]
        curve = rest_to_rest(
            points,
            velocity=unit * way.velocity,
            acceleration=unit * way.acceleration,
            dwell=way.dwell,
        )
        return CurveCourse(curve, repeat=way.repeat)
    return SwingingCourse(unit * way.amplitude, way.frequency, begin=way.begin, ramp=way.ramp)
