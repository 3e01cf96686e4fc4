"""Shapes of surfaces and regions: what each of them offers, and where it stands.

A shape is a dataclass that a person writes, as ``!Cylinder {radius: 0.1}``; its file holds the
surface and the region that it stands for. Lengths in m, angles in degrees.
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
        folder: Where relative file names start.
        smoothness: k of the class C^k of splines, unless the shape says another.
        needed_by: What needs that class, for messages.
        progress: Told the fraction done and what is done, where that takes its time.
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


@dc.dataclass
class PlacedShape(Parameters, ABC):
    """Where a shape stands.

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
            inside: Whether what is enclosed is admissible, or what is below.

        Raises:
            InputError: If a file cannot be used, or no region be made of it.
        """

    @abstractmethod
    def drawn_surfaces(self, inputs: ShapeInputs) -> Sequence[Surface]:
        """Return what of the region's boundary is drawn.

        Args:
            inputs: Folder of files.
        """


class PlacedSurface(PlacedShape):
    """A shape that is a parametrized surface."""

    @abstractmethod
    def surface(self, inputs: ShapeInputs) -> MadeSurface:
        """Return the surface, whatever its class.

        Args:
            inputs: Folder of files, and class of splines.

        Raises:
            InputError: If a file cannot be used, or no surface be made.
        """

    def smooth_sheet(self, inputs: ShapeInputs) -> MadeSurface:
        """Return the surface, as smooth as needed and a single sheet.

        Args:
            inputs: As for :meth:`surface`.

        Raises:
            InputError: If it cannot be made, is less smooth, or no single sheet.
        """
        made, needed = self.surface(inputs), inputs.smoothness
        if made.surface.smoothness < needed:
            raise InputError(
                f"smoothness: class C^{made.surface.smoothness:g}, and {inputs.needed_by} needs "
                f"C^{needed}; write smoothness: 0 for what the law needs"
            )
        check_single_sheet(made.surface)
        return made

    def drawn_surfaces(self, inputs: ShapeInputs) -> Sequence[Surface]:
        """Return what of the region's boundary is drawn."""
        return [self.surface(inputs).surface]


def pair(values: object) -> Pair:
    """Return two numbers as floats."""
    first, last = np.asarray(values, dtype=float)
    return float(first), float(last)


def require_ends(key: str, values: list[float]) -> None:
    """Refuse what are no ends of a length [m]."""
    require_numbers(key, values, 2)
    good = -FARTHEST <= values[0] < values[1] <= FARTHEST
    require(good, key, values, f"two numbers that increase, of at most {FARTHEST:g} m")
