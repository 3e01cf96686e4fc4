"""Shapes of surfaces that come from files. Lengths in m, angles in degrees."""

import dataclasses as dc

from diagrams.scenario.checks import (
    require,
    require_direction,
    require_length,
    require_place,
)
from diagrams.scenario.surface_shapes import Placed, Turned
from pfsc_drake.geometry.size import FARTHEST
from pfsc_drake.yaml.reading import FILE

_UNITS = ("m", "cm", "mm", "inch")
_BASES = ("auto", "plane", "cylinder")
_SHORTEST_TOLERANCE = 1e-7  # m


def _require_smoothness(value: int) -> None:
    allowed = "0 for what the law needs, or 2 to 6"
    require(value == 0 or 2 <= value <= 6, "smoothness", value, allowed)


def _require_length_or_zero(key: str, value: float) -> None:
    good = value == 0.0 or _SHORTEST_TOLERANCE <= value <= FARTHEST
    require(good, key, value, f"0, or {_SHORTEST_TOLERANCE:g} m to {FARTHEST:g} m")


@dc.dataclass
class Fitted(Placed):
    """A surface fitted to points, as a workpiece is scanned; placed as its file's axes are.

    Attributes:
        file: CSV file with columns ``x, y, z``, or vertices of an STL, OBJ or PLY file; relative
            to the scenario's folder.
        unit: Of its numbers: ``m``, ``cm``, ``mm``, ``inch``.
        grid: ``[rows, columns]`` of points that are given row by row, theta_1 leading from row
            to row; empty for scattered points.
        closed: Whether a grid closes from its last row, or column, to the first.
        tolerance: The smoothest surface that misses no point by more than this [m]; zero for the
            surface that predicts points best that it has not seen.
        interpolate: Whether the surface goes through all points, of a grid without noise.
        smoothness: Class C^k; 0 chooses what the law needs.
        base: Over which surface scattered points are heights: ``auto``, ``plane``, ``cylinder``.
        base_axis: Axis of that cylinder; empty if it is to be found.
        base_point: A point on that axis [m].
        seen_from: A point on the side that the normal points to, world axes [m]; empty for
            upwards on a plane, outward on a cylinder.
        along: Direction that theta_1 leans to on a plane, world axes; empty for the longer side.
        largest_hole: Largest distance of a place of the surface from the nearest scattered point
            [m]; zero for four times the distance of points.
        trim: Whether to take the largest part that has no larger hole, instead of refusing.
    """

    file: str = dc.field(default="", metadata=FILE)
    unit: str = "m"
    grid: list[int] = dc.field(default_factory=list)
    closed: list[bool] = dc.field(default_factory=lambda: [False, False])
    tolerance: float = 0.0
    interpolate: bool = False
    smoothness: int = 0
    base: str = "auto"
    base_axis: list[float] = dc.field(default_factory=list)
    base_point: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0])
    seen_from: list[float] = dc.field(default_factory=list)
    along: list[float] = dc.field(default_factory=list)
    largest_hole: float = 0.0
    trim: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        for key, values in {"unit": _UNITS, "base": _BASES}.items():
            require(getattr(self, key) in values, key, getattr(self, key), ", ".join(values))
        _require_smoothness(self.smoothness)
        for key in ("tolerance", "largest_hole"):
            _require_length_or_zero(key, getattr(self, key))
        good = len(self.grid) in (0, 2) and min(self.grid, default=2) >= 2
        require(good, "grid", self.grid, "empty, or [rows, columns] of two or more each")
        require(len(self.closed) == 2, "closed", self.closed, "two of true and false")
        self._require_of_grids()
        for key in ("base_axis", "along"):
            if getattr(self, key):
                require_direction(key, getattr(self, key))
        for key in ("base_point", "seen_from"):
            if getattr(self, key):
                require_place(key, getattr(self, key))
        if self.base_axis:
            require(self.base == "cylinder", "base", self.base, "cylinder, with base_axis")

    def _require_of_grids(self) -> None:
        """Refuse what says nothing of the points that are given."""
        if self.grid:
            scattered = {"base": self.base != "auto", "seen_from": bool(self.seen_from)}
            scattered |= {
                "along": bool(self.along),
                "largest_hole": self.largest_hole > 0.0,
                "trim": self.trim,
            }
            for key, given in scattered.items():
                allowed = "for scattered points alone; leave out it or grid"
                require(not given, key, getattr(self, key), allowed)
            both = self.interpolate and self.tolerance > 0.0
            require(not both, "tolerance", self.tolerance, "0 with interpolate: true")
        else:
            allowed = "of a grid alone; write grid: [rows, columns]"
            require(not self.interpolate, "interpolate", self.interpolate, allowed)
            require(not any(self.closed), "closed", self.closed, allowed)


@dc.dataclass
class Revolved(Turned):
    """A surface that a profile leaves when it turns about the third axis; theta_1 is the angle.

    Attributes:
        file: CSV file with columns ``radius, height`` [m], points of the profile in order,
            which theta_2 runs along; relative to the scenario's folder.
        closed: Whether the profile closes from the last point to the first.
        smoothness: Class C^k of the spline through it; 0 chooses what the law needs.
    """

    file: str = dc.field(default="", metadata=FILE)
    closed: bool = False
    smoothness: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_smoothness(self.smoothness)


@dc.dataclass
class Extruded(Placed):
    """A surface that a profile leaves when it is moved along a line, which theta_2 runs along.

    Attributes:
        file: CSV file with columns ``x, y, z`` [m], points of the profile in order, which theta_1
            runs along; relative to the scenario's folder.
        direction: Of the line, in the file's axes, of any length.
        length: Of the line [m].
        closed: Whether the profile closes from the last point to the first.
        smoothness: Class C^k of the spline through it; 0 chooses what the law needs.
    """

    file: str = dc.field(default="", metadata=FILE)
    direction: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])
    length: float = 0.2
    closed: bool = False
    smoothness: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        require_direction("direction", self.direction)
        require_length("length", self.length)
        _require_smoothness(self.smoothness)
