"""The path of a scenario. Lengths in m, angles in degrees."""

import dataclasses as dc
from typing import Union

from diagrams.scenario.checks import require, require_numbers, require_positive


@dc.dataclass
class Line:
    """A straight path.

    Attributes:
        start: First point [m].
        end: Last point [m].
    """

    start: list[float] = dc.field(default_factory=lambda: [0.8, 0.0, 1.0])
    end: list[float] = dc.field(default_factory=lambda: [0.8, 0.3, 1.0])

    def __post_init__(self) -> None:
        require_numbers("start", self.start, 3)
        require_numbers("end", self.end, 3)


@dc.dataclass
class Circle:
    """A circular path ``center + radius (u cos theta + v sin theta)``.

    Attributes:
        center: Center [m].
        radius: Radius [m].
        axis_u: Direction of ``u``.
        axis_v: Direction of ``v``.
    """

    center: list[float] = dc.field(default_factory=lambda: [0.8, 0.0, 1.0])
    radius: float = 0.15
    axis_u: list[float] = dc.field(default_factory=lambda: [0.0, 1.0, 0.0])
    axis_v: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])

    def __post_init__(self) -> None:
        require_positive("radius", self.radius)
        for key in ("center", "axis_u", "axis_v"):
            require_numbers(key, getattr(self, key), 3)


@dc.dataclass
class BentLemniscate:
    """The vertically bent lemniscate (3.87)."""


@dc.dataclass
class Waypoints:
    """A spline through the waypoints of a CSV file, orientation included if it has one.

    Attributes:
        file: CSV file, relative to the scenario's folder.
        closed: Whether the path is closed.
        parametrization: ``chord`` or ``centripetal``.
        smoothness: Class C^k of the spline; 0 chooses what the law needs.
    """

    file: str = ""
    closed: bool = False
    parametrization: str = "chord"
    smoothness: int = 0

    def __post_init__(self) -> None:
        allowed = ("chord", "centripetal")
        require(
            self.parametrization in allowed,
            "parametrization",
            self.parametrization,
            ", ".join(allowed),
        )
        require(0 <= self.smoothness <= 6, "smoothness", self.smoothness, "0 to 6")


# the first is what a shape without a tag means
PathShape = Union[Waypoints, BentLemniscate, Circle, Line]  # noqa: UP007 (Drake's YAML needs it)


@dc.dataclass
class Keyframe:
    """Orientation of the tool at one point of the path.

    Attributes:
        theta: Path parameter, as a fraction of the path's domain (0..1).
        angles_deg: Euler angles [deg], in the order of the convention's name.
    """

    theta: float = 0.0
    angles_deg: list[float] = dc.field(default_factory=lambda: [0.0, 0.0, 0.0])


@dc.dataclass
class OrientationParameters:
    """Orientation along the path.

    Attributes:
        convention: ``zyx`` (2.7) or ``zyz`` (2.6).
        keyframes: Orientations to interpolate; one alone is kept everywhere; on a
            closed path the first is repeated at the end.
    """

    convention: str = "zyx"
    keyframes: list[Keyframe] = dc.field(default_factory=list)

    def __post_init__(self) -> None:
        require(self.convention in ("zyx", "zyz"), "convention", self.convention, "zyx, zyz")
        for i, keyframe in enumerate(self.keyframes):
            require_numbers(f"keyframes[{i}].angles_deg", keyframe.angles_deg, 3)


@dc.dataclass
class PathParameters:
    """The path.

    Attributes:
        shape: Position, one of ``!BentLemniscate``, ``!Circle``, ``!Line``, ``!Waypoints``.
        orientation: Orientation; without keyframes the waypoint file's, or none.
    """

    shape: PathShape = dc.field(default_factory=BentLemniscate)
    orientation: OrientationParameters = dc.field(default_factory=OrientationParameters)
