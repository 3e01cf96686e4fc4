"""The surface of a scenario, and shapes that come from files. Lengths in m, angles in degrees."""

import dataclasses as dc
from typing import Union

from diagrams.scenario.checks import (
    LARGEST_ANGLE,
    require,
    require_direction,
    require_length,
    require_numbers,
    require_one_of,
    require_place,
)
from diagrams.scenario.surface_shapes import (
    Cone,
    Cylinder,
    Paraboloid,
    Placed,
    Plane,
    Sphere,
    Torus,
    Turned,
)
from pfsc_drake.geometry.curves.curve import FARTHEST
from pfsc_drake.geometry.files.unit import UNITS
from pfsc_drake.yaml.fields import equal
from pfsc_drake.yaml.reading import FILE

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
        unit: Unit of its numbers: ``m``, ``cm``, ``mm``, ``inch``.
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
        for key, values in {"unit": UNITS, "base": _BASES}.items():
            require_one_of(key, getattr(self, key), values)
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
        direction: Direction of the line, in the file's axes, of any length.
        length: Length of the line [m].
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


_KINDS = ("none", "given", "normal")
_TASKS = ("full", "tool_axis", "yaw")
_CONVENTIONS = ("zyx", "zyz")
_JACOBIANS = ("geometric", "analytic")

FileShape = Fitted | Revolved | Extruded
NumberShape = Paraboloid | Plane | Cylinder | Cone | Sphere | Torus
# the first is what a shape without a tag means
SurfaceShape = Union[  # noqa: UP007
    Paraboloid, Plane, Cylinder, Cone, Sphere, Torus, Fitted, Revolved, Extruded
]


def require_jacobian(jacobian: str, key: str, value: str) -> None:
    """Refuse an unknown Jacobian, and the analytic one where not all of an orientation matters.

    Args:
        jacobian: What the scenario says.
        key: What says how much of the orientation matters.
        value: Its value; ``full`` for all of it.
    """
    require_one_of("jacobian", jacobian, _JACOBIANS)
    good = jacobian == "geometric" or value == "full"
    require(good, "jacobian", jacobian, f"geometric with {key}: {value}")


@dc.dataclass
class SurfaceOrientationParameters:
    """Orientation of the tool along a surface.

    Attributes:
        kind: ``none``: position only; ``given``: the same everywhere; ``normal``: that of the
            frame of first tangent, second and normal.
        convention: ``zyx`` (2.7) or ``zyz`` (2.6); of an ``analytic`` Jacobian too.
        angles_deg: Euler angles [deg]: of the orientation, or of its turn away from the frame.
        task: ``full``; ``tool_axis``, whose turn about itself is free; or ``yaw``, the turn about
            an axis in the world alone.
        tool_axis: Axis in the tool frame, of any length, for ``tool_axis``.
        yaw_axis: Axis in the world, of any length, for ``yaw``; by default the vertical.
        jacobian: ``geometric`` or ``analytic``, see ``path.orientation.jacobian``.
    """

    kind: str = "none"
    convention: str = "zyx"
    angles_deg: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0], metadata=equal(3))
    task: str = "full"
    tool_axis: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])
    yaw_axis: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])
    jacobian: str = "geometric"

    def __post_init__(self) -> None:
        for key, values in {"kind": _KINDS, "convention": _CONVENTIONS, "task": _TASKS}.items():
            require_one_of(key, getattr(self, key), values)
        require_jacobian(self.jacobian, "task", self.task)
        require_jacobian(self.jacobian, "kind", "full" if self.kind != "none" else self.kind)
        require_numbers("angles_deg", self.angles_deg, 3)
        good = max(map(abs, self.angles_deg)) <= LARGEST_ANGLE
        allowed = f"3 numbers of at most {LARGEST_ANGLE:g} deg"
        require(good, "angles_deg", self.angles_deg, allowed)
        require_direction("tool_axis", self.tool_axis)
        require_direction("yaw_axis", self.yaw_axis)


@dc.dataclass
class SurfaceParameters:
    """The surface.

    Attributes:
        shape: Position, one of ``!Paraboloid``, ``!Plane``, ``!Cylinder``, ``!Cone``, ``!Sphere``,
            ``!Torus``, or from a file ``!Fitted``, ``!Revolved``, ``!Extruded``.
        orientation: Orientation.
    """

    shape: SurfaceShape = dc.field(default_factory=Paraboloid)
    orientation: SurfaceOrientationParameters = dc.field(
        default_factory=SurfaceOrientationParameters
    )
