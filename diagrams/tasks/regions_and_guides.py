"""Virtual fixtures of a scenario: regions for laws, logs and drawings, and guides."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np

from diagrams.scenario.manifolds import PathParameters
from diagrams.scenario.virtual_fixtures import FixtureParameters, RegionParameters
from diagrams.tasks.task_geometry import make_path
from pfsc_drake.control.fixtures.fixture_parameters import Fixture
from pfsc_drake.control.fixtures.guides import Guide
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.geometry.regions.moving import MovingRegion
from pfsc_drake.geometry.regions.region import Region
from pfsc_drake.geometry.regions.region_checks import (
    blocked_start,
    refuse_forbidden_start,
    refuse_same_regions,
    tangent_regions,
)
from pfsc_drake.geometry.shapes.shape import ShapeInputs
from pfsc_drake.geometry.shapes.tool_orientation import OrientationParameters
from pfsc_drake.geometry.surfaces.parametric_surface import Surface

# a guide needs positions only
_AS_SMOOTH_AS_FOR = "velocity_servo"


@dataclass(frozen=True, kw_only=True)
class DrawnFixture(Fixture):
    """A region that a tool may not enter, with its drawing.

    Attributes:
        surfaces: Surfaces of its boundary to draw, at rest.
    """

    surfaces: Sequence[Surface]


def make_fixtures(
    parameters: FixtureParameters,
    start: np.ndarray,
    folder: FilePath,
    progress: Progress | None = None,
) -> tuple[list[DrawnFixture], list[str]]:
    """Return the regions of a scenario, and warnings about them, one sentence each.

    Args:
        parameters: Parameters of the scenario.
        start: Start of the tool point [m], shape (3,).
        folder: Base folder of relative file names.
        progress: Receives the fraction done and the name of the step, where that takes its time.

    Raises:
        InputError: If a region cannot be created, is given twice, or covers a start that is to be
            refused.
    """
    fixtures = []
    for number, (name, region) in enumerate(zip(parameters.names, parameters.regions, strict=True)):
        try:
            fixtures.append(_make_fixture(name, region, folder, progress))
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
    warnings = [*blocked_start(hard, start), *tangent_regions(hard, start)]
    return fixtures, [f"fixtures: {warning}" for warning in warnings]


def _make_fixture(
    name: str, parameters: RegionParameters, folder: FilePath, progress: Progress | None
) -> DrawnFixture:
    region = make_region(parameters, folder, progress)
    stiffness = math.inf if parameters.stiffness is None else parameters.stiffness
    surfaces = parameters.shape.drawn_surfaces(ShapeInputs(folder))
    return DrawnFixture(region, stiffness, name=name, surfaces=surfaces)


def make_region(
    parameters: RegionParameters, folder: FilePath, progress: Progress | None = None
) -> Region | MovingRegion:
    """Return a region, which moves if the scenario has a motion for it.

    Args:
        parameters: Parameters of the scenario.
        folder: Base folder of relative file names.
        progress: Receives the fraction done and the name of the step, where that takes its time.

    Raises:
        InputError: If a file cannot be used, or does not define a region.
    """
    inputs = ShapeInputs(folder, progress=progress)
    region = parameters.shape.region(inputs, inside=parameters.inside)
    return region if parameters.motion is None else parameters.motion.moving(region)


def make_guides(
    parameters: FixtureParameters, folder: FilePath, progress: Progress | None = None
) -> dict[str, Guide]:
    """Return the paths that attract a tool, by their names.

    Args:
        parameters: Parameters of the scenario.
        folder: Base folder of relative file names.
        progress: Receives the fraction done and the name of the step, where that takes its time.

    Raises:
        InputError: If a path cannot be created.
    """
    guides = {}
    for number, (name, guide) in enumerate(
        zip(parameters.guide_names, parameters.guides, strict=True)
    ):
        shape = PathParameters(guide.shape, OrientationParameters(task="none"))
        try:
            path = make_path(shape, _AS_SMOOTH_AS_FOR, folder, progress)
            guides[name] = Guide(path, guide.stiffness, guide.reach)
        except InputError as error:
            raise InputError(f"fixtures.guides[{number}]: {error}") from None
    return guides
