"""Virtual fixtures of a scenario: regions as rules, logs and pictures need them, and guides."""

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

# a place on it is all that is asked of a guide
_AS_SMOOTH_AS_FOR = "velocity_servo"


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
    surfaces = said.shape.drawn_surfaces(ShapeInputs(folder))
    return DrawnFixture(region, stiffness, name=name, surfaces=surfaces)


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
    inputs = ShapeInputs(folder, progress=progress)
    region = parameters.shape.region(inputs, inside=parameters.inside)
    return region if parameters.motion is None else parameters.motion.moving(region)


def make_guides(
    parameters: FixtureParameters, folder: FilePath, progress: Progress | None = None
) -> dict[str, Guide]:
    """Return the paths that attract a tool, by their names.

    Args:
        parameters: What the scenario says.
        folder: Where relative file names start.
        progress: Told the fraction done and what is done, where that takes its time.

    Raises:
        InputError: If a path cannot be made.
    """
    guides = {}
    for number, (name, said) in enumerate(
        zip(parameters.guide_names, parameters.guides, strict=True)
    ):
        shape = PathParameters(said.shape, OrientationParameters(task="none"))
        try:
            path = make_path(shape, _AS_SMOOTH_AS_FOR, folder, progress)
            guides[name] = Guide(path, said.stiffness, said.reach)
        except InputError as error:
            raise InputError(f"fixtures.guides[{number}]: {error}") from None
    return guides
