"""The forbidden regions of a scenario, as rules, logs and pictures need them."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np

from diagrams.scenario.fixtures import (
    Box,
    FixtureParameters,
    RegionParameters,
    RegionShape,
    Shift,
    Turn,
    Visiting,
    encloses,
)
from diagrams.scenario.surface import Extruded, Fitted, Revolved
from diagrams.scenario.surface_shapes import Cone, Cylinder, Paraboloid, Sphere, Torus
from diagrams.tasks.surface import profile_from_file, surface_from_shape
from pfsc_drake.control.fixtures.parameters import Fixture
from pfsc_drake.control.law.reference import rest_to_rest
from pfsc_drake.control.law.swing import SwingingCourse
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.geometry.regions.checks import (
    blocked_start,
    refuse_forbidden_start,
    refuse_same_regions,
    tangent_regions,
)
from pfsc_drake.geometry.regions.moving import (
    Course,
    CurveCourse,
    MovingRegion,
    ShiftedRegion,
    TurningRegion,
)
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
from pfsc_drake.geometry.surfaces.shapes import plane
from pfsc_drake.geometry.surfaces.sheets import check_single_sheet
from pfsc_drake.geometry.surfaces.surface import Surface

# class C^k of a surface that is drawn, the least there is
_DRAWN = 2


@dataclass(frozen=True, kw_only=True)
class DrawnFixture(Fixture):
    """A region that a tool may not enter, with its drawing.

    Attributes:
        surfaces: What of its boundary is drawn, where it is at rest.
    """

    surfaces: Sequence[Surface]


def make_fixtures(
    parameters: FixtureParameters,
    start: np.ndarray,
    folder: FilePath,
    progress: Progress | None = None,
) -> tuple[list[DrawnFixture], list[str]]:
    """Return the regions of a scenario, and what is odd about them, one sentence each.

    Args:
        parameters: What the scenario says.
        start: Where the tool starts [m], shape (3,).
        folder: Where relative file names start.
        progress: Told the fraction done and what is done, where that takes its time.

    Raises:
        InputError: If a region cannot be made, is given twice, or covers the start and that is to
            be refused.
    """
    fixtures = []
    for number, (name, said) in enumerate(zip(parameters.names, parameters.regions, strict=True)):
        try:
            fixtures.append(_make_fixture(name, said, folder, progress))
        except InputError as error:
            raise InputError(f"fixtures.regions[{number}]: {error}") from None
    by_name = {fixture.name: fixture.region for fixture in fixtures}
    hard = {f.name: f.region for f in fixtures if f.stiffness == math.inf}
    try:
        refuse_same_regions(by_name, start)
        if parameters.start_inside == "refuse":
            refuse_forbidden_start(hard, start)
    except InputError as error:
        raise InputError(f"fixtures: {error}") from None
    odd = [*blocked_start(hard, start), *tangent_regions(hard, start)]
    return fixtures, [f"fixtures: {sentence}" for sentence in odd]


def _make_fixture(
    name: str, said: RegionParameters, folder: FilePath, progress: Progress | None
) -> DrawnFixture:
    region = make_region(said, folder, progress)
    stiffness = math.inf if said.stiffness is None else said.stiffness
    if isinstance(said.shape, Box):
        return DrawnFixture(region, stiffness, name=name, surfaces=_faces(said.shape))
    surface = surface_from_shape(said.shape, _DRAWN, folder).surface
    return DrawnFixture(region, stiffness, name=name, surfaces=[surface])


def _faces(box: Box) -> Sequence[Surface]:
    """Return the six sides of a box."""
    axes, half = box.rotation, np.array(box.size) / 2.0
    faces = []
    for k, sign in itertools.product(range(3), (-1.0, 1.0)):
        i, j = (k + 1) % 3, (k + 2) % 3
        rotation = np.column_stack([axes[:, i], axes[:, j], axes[:, k]])
        size = ((-half[i], half[i]), (-half[j], half[j]))
        faces.append(plane(size, box.origin + sign * half[k] * axes[:, k], rotation))
    return faces


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
    profile, _ = profile_from_file(shape, _SMOOTHNESS, folder)
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
