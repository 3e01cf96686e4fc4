"""The path of a scenario. Lengths in m, angles in degrees."""

import dataclasses as dc
import math
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
from diagrams.scenario.streamed import Streamed
from diagrams.scenario.surface import SurfaceShape, require_jacobian
from pfsc_drake.geometry.curves.curve import FARTHEST, SHORTEST
from pfsc_drake.geometry.files.unit import UNITS
from pfsc_drake.yaml.fields import equal
from pfsc_drake.yaml.reading import FILE

_SHORTEST_TOLERANCE = 1e-7  # m
TASKS = ("full", "tool_axis", "yaw", "none")


@dc.dataclass
class Line:
    """A straight path.

    Attributes:
        start: First point [m], at most 1e4 from the origin.
        end: Last point [m], at least 1e-4 from the first.
    """

    start: list[float] = dc.field(default_factory=lambda: [0.8, 0.0, 1.0])
    end: list[float] = dc.field(default_factory=lambda: [0.8, 0.3, 1.0])

    def __post_init__(self) -> None:
        require_place("start", self.start)
        require_place("end", self.end)
        require_length("distance of start and end", math.dist(self.start, self.end))


@dc.dataclass
class Circle:
    """A circular path ``center + radius (u cos theta + v sin theta)``.

    Attributes:
        center: Center [m], at most 1e4 from the origin.
        radius: Radius [m], 1e-4 to 1e4.
        axis_u: Direction of ``u``, of any length.
        axis_v: Direction in the plane of the circle, at least 0.1 deg from ``u``; ``v`` is
            its part perpendicular to ``u``. Both lengths are made one.
    """

    center: list[float] = dc.field(default_factory=lambda: [0.8, 0.0, 1.0])
    radius: float = 0.15
    axis_u: list[float] = dc.field(default_factory=lambda: [0.0, 1.0, 0.0])
    axis_v: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])

    def __post_init__(self) -> None:
        require_length("radius", self.radius)
        require_place("center", self.center)
        for key in ("axis_u", "axis_v"):
            require_numbers(key, getattr(self, key), 3)


@dc.dataclass
class BentLemniscate:
    """The vertically bent lemniscate (3.87)."""


@dc.dataclass
class Waypoints:
    """A path through the waypoints of a CSV file, or near them; orientation included.

    It is a spline through all of them, unless ``tolerance`` or ``corner_distance`` is given.
    Columns of the file: ``x, y, z``; if it has an orientation, ``zyx_1, zyx_2, zyx_3``,
    ``zyz_1, ...`` or ``roll, pitch, yaw`` [rad], ``zyx_deg_1, ...``, ``zyz_deg_1, ...`` or
    ``roll_deg, ...`` [deg], the rotation vector ``rx, ry, rz`` [rad], ``qw, qx, qy, qz``, or
    ``r11, r12, ..., r33``; for the task ``yaw`` the turn ``yaw`` or ``yaw_deg`` alone, which a
    single keyframe, the tool's tilt, may go with; see :func:`read_waypoints`.

    Attributes:
        file: CSV file, relative to the scenario's folder.
        unit: Unit of ``x, y, z``: ``m``, ``cm``, ``mm``, ``inch``.
        closed: Whether the path is closed.
        parametrization: ``chord`` or ``centripetal``, of a spline through all waypoints.
        smoothness: Class C^k of the spline; 0 chooses what the law needs.
        tolerance: For noisy points: the smoothest path that misses none by more than this
            [m]; zero goes through all of them.
        tolerance_deg: The same of the orientation [deg], where ``tolerance`` is given.
        corner_distance: For sparse corners: straight lines from point to point, blended up
            to this distance from each corner [m], 1e-4 or more and at most over half a line;
            zero for none.
    """

    file: str = dc.field(default="", metadata=FILE)
    unit: str = "m"
    closed: bool = False
    parametrization: str = "chord"
    smoothness: int = 0
    tolerance: float = 0.0
    tolerance_deg: float = 1.0
    corner_distance: float = 0.0

    def __post_init__(self) -> None:
        require_one_of("unit", self.unit, UNITS)
        require_one_of("parametrization", self.parametrization, ("chord", "centripetal"))
        require(0 <= self.smoothness <= 6, "smoothness", self.smoothness, "0 to 6")
        # a blend shorter than any path is no motion, and takes long to be tabulated
        for key, least in {"tolerance": _SHORTEST_TOLERANCE, "corner_distance": SHORTEST}.items():
            value = getattr(self, key)
            good = value == 0.0 or least <= value <= FARTHEST
            require(good, key, value, f"0, or {least:g} m to {FARTHEST:g} m")
        both = self.tolerance > 0.0 and self.corner_distance > 0.0
        require(not both, "corner_distance", self.corner_distance, "0 where tolerance is given")
        good = 0.001 <= self.tolerance_deg <= 90.0
        require(good, "tolerance_deg", self.tolerance_deg, "0.001 deg to 90 deg")


@dc.dataclass
class OnSurface:
    """A path on the scenario's ``surface``, whose transversal coordinates are normal and sideways.

    Its orientation is ``surface.orientation``. It is a spline through waypoints, given either by
    the surface's parameters or by points in space.

    Attributes:
        thetas: Waypoints ``[theta_1, theta_2]``; two are joined by a straight line in the
            parameters. Closed directions of the surface may be led round and round.
        file: CSV file with columns ``x, y, z`` instead, relative to the scenario's folder;
            the path is where the surface is nearest to them.
        unit: Unit of ``x, y, z``: ``m``, ``cm``, ``mm``, ``inch``.
        max_distance: Largest distance of these points from the surface [m].
        closed: Whether the path is closed.
    """

    thetas: list[list[float]] = dc.field(default_factory=list)
    file: str = dc.field(default="", metadata=FILE)
    unit: str = "m"
    max_distance: float = 1e-3
    closed: bool = False

    def __post_init__(self) -> None:
        require_one_of("unit", self.unit, UNITS)
        require(bool(self.file) or self.unit == "m", "unit", self.unit, "m without a file")
        for i, theta in enumerate(self.thetas):
            require_numbers(f"thetas[{i}]", theta, 2)
        good = 0.0 < self.max_distance <= FARTHEST
        require(good, "max_distance", self.max_distance, f"a positive number up to {FARTHEST:g} m")


@dc.dataclass
class Intersection:
    """The edge in which two surfaces meet, along the cross product of their normals.

    Attributes:
        surfaces: Both, as ``surface.shape``; the edge ends where one of them does.
        near: A point [m]: of several edges the nearest is meant, and a closed one begins there;
            empty if there is only one.
        tolerance: How far a spline may be from the edge, 1e-9 or more [m]. Lines, circles and
            ellipses are exact.
    """

    surfaces: list[SurfaceShape] = dc.field(default_factory=list)
    near: list[float] = dc.field(default_factory=list)
    tolerance: float = 1e-6

    def __post_init__(self) -> None:
        count = len(self.surfaces)
        require(
            count in (0, 2), "surfaces", f"{count} given", "2, e.g. [!Plane {..}, !Sphere {..}]"
        )
        if self.near:
            require_place("near", self.near)
        good = 1e-9 <= self.tolerance <= FARTHEST
        require(good, "tolerance", self.tolerance, f"1e-09 m to {FARTHEST:g} m")


# the first is what a shape without a tag means
PathShape = Union[  # noqa: UP007 (Drake's YAML needs it)
    Waypoints, BentLemniscate, Circle, Line, OnSurface, Intersection, Streamed
]


@dc.dataclass
class Keyframe:
    """Orientation of the tool at one point of the path.

    Attributes:
        theta: Path parameter, as a fraction of the path's domain (0..1).
        angles_deg: Euler angles [deg], in the order of the convention's name; at most 3600.
    """

    theta: float = 0.0
    angles_deg: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0], metadata=equal(3))


@dc.dataclass
class OrientationParameters:
    """Orientation along the path.

    Attributes:
        convention: ``zyx`` (2.7) or ``zyz`` (2.6).
        keyframes: Orientations to interpolate; one alone is kept everywhere; on a
            closed path the first is repeated at the end.
        task: What of it the tool follows: ``full``, all that the path has; ``tool_axis``, the
            direction of an axis of the tool, about which it may turn as it likes; ``yaw``, the
            turn about an axis in the world, the tool's tilt being as it is (four outputs, as an
            SCARA has); ``none``.
        tool_axis: The axis, in the tool frame, of any length.
        yaw_axis: The axis of ``yaw``, in the world, of any length; by default the vertical.
        jacobian: How the errors of orientation are told: ``geometric``, by the ZYX angles of the
            turn from the reference to the tool; or, for comparison, ``analytic`` (2.16), by the
            Euler angles of the tool in the world less those of the reference, of ``convention``,
            which are singular where these are. Only for the task ``full``.
    """

    convention: str = "zyx"
    keyframes: list[Keyframe] = dc.field(default_factory=list)
    task: str = "full"
    tool_axis: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])
    yaw_axis: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])
    jacobian: str = "geometric"

    def __post_init__(self) -> None:
        require_one_of("convention", self.convention, ("zyx", "zyz"))
        require_one_of("task", self.task, TASKS)
        require_jacobian(self.jacobian, "task", self.task)
        require_direction("tool_axis", self.tool_axis)
        require_direction("yaw_axis", self.yaw_axis)
        for i, keyframe in enumerate(self.keyframes):
            key, angles = f"keyframes[{i}].angles_deg", keyframe.angles_deg
            require_numbers(key, angles, 3)
            good = max(map(abs, angles)) <= LARGEST_ANGLE
            require(good, key, angles, f"3 numbers of at most {LARGEST_ANGLE:g} deg")
            good = 0.0 <= keyframe.theta <= 1.0
            require(good, f"keyframes[{i}].theta", keyframe.theta, "0 to 1, a fraction")


@dc.dataclass
class PathParameters:
    """The path.

    Attributes:
        shape: Position, one of ``!BentLemniscate``, ``!Circle``, ``!Line``, ``!Waypoints``,
            ``!OnSurface``, ``!Intersection``, ``!Streamed``.
        orientation: Orientation; without keyframes the waypoint file's, or none.
    """

    shape: PathShape = dc.field(default_factory=BentLemniscate)
    orientation: OrientationParameters = dc.field(default_factory=OrientationParameters)
