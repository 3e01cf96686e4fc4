"""The forbidden regions of a scenario, as rules, logs and pictures need them."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np

from diagrams.scenario.fixtures import FixtureParameters
from diagrams.scenario.region import Box, RegionParameters
from diagrams.tasks.region import make_region
from diagrams.tasks.surface import surface_from_shape
from pfsc_drake.control.fixtures.parameters import Fixture
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.geometry.regions.checks import (
    blocked_start,
    refuse_forbidden_start,
    refuse_same_regions,
    tangent_regions,
)
from pfsc_drake.geometry.surfaces.shapes import plane
from pfsc_drake.geometry.surfaces.surface import Surface

# class C^k of a surface that is drawn, the least there is
_DRAWN = 2


@dataclass(frozen=True, kw_only=True)
class DrawnFixture(Fixture):
    """A region that a tool may not enter, with a name and a look.

    Attributes:
        name: Kind of its shape and its number, from 1 on.
        surfaces: What of its boundary is drawn, where it is at rest.
    """

    name: str
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
