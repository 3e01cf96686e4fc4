"""Shapes of surfaces and regions: their common interface and placement.

A shape is a dataclass that a user writes, as ``!Cylinder {radius: 0.1}``; its file holds the
surface and the region that it describes. Lengths in m, angles in degrees.
"""

import dataclasses as dc
from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np

from pfsc_drake.checks import FARTHEST, require, require_numbers
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.geometry.regions.region import Region
from pfsc_drake.geometry.surfaces.parametric_surface import Surface, rotation_from_axes
from pfsc_drake.geometry.surfaces.penalized_surface import Residuals
from pfsc_drake.geometry.surfaces.sheets import check_single_sheet
from pfsc_drake.yaml.rules import Direction, MaybeDirection, Parameters, Point, Range

Pair = tuple[float, float]
# class C^k of the surface of a region, and of one that is drawn
_REGION_SMOOTHNESS = 2
# class C^k of splines
Smoothness = Annotated[int, Range(2, 6, besides=0, words="0 for what the law needs, or 2 to 6")]


@dc.dataclass(frozen=True)
class ShapeInputs:
    """Inputs of the geometry of a shape, beside its own numbers.

    Attributes:
        folder: Folder of relative file names.
        smoothness: k of the class C^k of splines, unless the shape has its own.
        needed_by: User of that class, for messages.
        progress: Callback with the fraction done and the name of the step, of long computations.
    """

    folder: Path
    smoothness: int = _REGION_SMOOTHNESS
    needed_by: str = "a region"
    progress: Progress | None = None

    def file(self, name: str) -> Path:
        """Return the file that a shape is read from.

        Raises:
            InputError: If it names none.
        """
        if not name:
            raise InputError("file: none; write file: NAME, relative to the scenario's folder")
        return self.folder / name


@dc.dataclass(frozen=True)
class SurfaceResult:
    """Surface of a shape, with the residuals of a fit.

    Attributes:
        surface: The surface.
        fit: Positions of fitted points relative to the surface, or None.
        notes: Sentences on ignored parts of a file.
    """

    surface: Surface
    fit: Residuals | None = None
    notes: tuple[str, ...] = ()


@dc.dataclass
class PlacedShape(Parameters, ABC):
    """Placement of a shape.

    Attributes:
        origin: A point of it, or on its axis [m].
        axis: Direction of its third axis, of any length.
        start: Direction to which its first axis leans; empty for x_0, or y_0 if the third axis is
            along x_0.
    """

    origin: Point = dc.field(default_factory=lambda: [0.0, 0.0, 0.0])
    axis: Direction = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])
    start: MaybeDirection = dc.field(default_factory=list)

    @property
    def rotation(self) -> np.ndarray:
        """Its axes as columns, shape (3, 3).

        Raises:
            InputError: If ``start`` is along ``axis``.
        """
        return rotation_from_axes(self.axis, self.start or None)

    @property
    def encloses(self) -> bool:
        """Whether it has an inside."""
        return True

    def check_side(self, admissible: str) -> None:
        """Refuse an admissible side that its region does not have.

        Args:
            admissible: Name of the side; empty for ``outside``, or ``above``.

        Raises:
            InputError: If it has no such side, or the shape is a part that bounds no region.
        """
        sides = ("inside", "outside") if self.encloses else ("above", "below")
        allowed = f"{' or '.join(sides)} of this !{type(self).__name__}"
        require(admissible in ("", *sides), "admissible", admissible, allowed)

    @abstractmethod
    def region(self, inputs: ShapeInputs, *, inside: bool) -> Region:
        """Return the region that it bounds.

        Args:
            inputs: Folder of files.
            inside: Whether the enclosed space is admissible, or the space below.

        Raises:
            InputError: If a file cannot be used, or bounds no region.
        """

    @abstractmethod
    def drawn_surfaces(self, inputs: ShapeInputs) -> Sequence[Surface]:
        """Return the drawn surfaces of the region's boundary.

        Args:
            inputs: Folder of files.
        """


class PlacedSurface(PlacedShape):
    """A shape that is a parametrized surface."""

    @abstractmethod
    def surface(self, inputs: ShapeInputs) -> SurfaceResult:
        """Return the surface, whatever its class.

        Args:
            inputs: Folder of files, and class of splines.

        Raises:
            InputError: If a file cannot be used, or defines no surface.
        """

    def smooth_sheet(self, inputs: ShapeInputs) -> SurfaceResult:
        """Return the surface, as smooth as needed and a single sheet.

        Args:
            inputs: As for :meth:`surface`.

        Raises:
            InputError: If it cannot be created, is less smooth, or no single sheet.
        """
        result, needed = self.surface(inputs), inputs.smoothness
        if result.surface.smoothness < needed:
            raise InputError(
                f"smoothness: class C^{result.surface.smoothness:g}, and {inputs.needed_by} needs "
                f"C^{needed}; write smoothness: 0 for what the law needs"
            )
        check_single_sheet(result.surface)
        return result

    def drawn_surfaces(self, inputs: ShapeInputs) -> Sequence[Surface]:
        """Return the drawn surfaces of the region's boundary."""
        return [self.surface(inputs).surface]


def pair(values: object) -> Pair:
    """Return two numbers as floats."""
    first, last = np.asarray(values, dtype=float)
    return float(first), float(last)


def require_ends(key: str, values: list[float]) -> None:
    """Refuse numbers that are not the ends of a length [m]."""
    require_numbers(key, values, 2)
    good = -FARTHEST <= values[0] < values[1] <= FARTHEST
    require(good, key, values, f"two numbers that increase, of at most {FARTHEST:g} m")
