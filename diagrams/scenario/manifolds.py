"""The path and the surface of a scenario. Lengths in m, angles in degrees."""

import dataclasses as dc
from typing import Union

from diagrams.scenario.streamed import Streamed
from pfsc_drake.geometry.shapes.intersection import Intersection
from pfsc_drake.geometry.shapes.on_surface import OnSurface
from pfsc_drake.geometry.shapes.paraboloid import Paraboloid
from pfsc_drake.geometry.shapes.path_shapes import BentLemniscate, Circle, Line
from pfsc_drake.geometry.shapes.surface_list import SurfaceShape
from pfsc_drake.geometry.shapes.through_waypoints import Waypoints
from pfsc_drake.geometry.shapes.tool_orientation import (
    OrientationParameters,
    SurfaceOrientationParameters,
)

# shapes of paths and of guides; the first is the default of a shape without a tag
FreePath = Union[Waypoints, BentLemniscate, Circle, Line]  # noqa: UP007 (Drake's YAML needs it)
PathShape = Union[FreePath, OnSurface, Intersection, Streamed]  # noqa: UP007
GuideShape = Union[FreePath, Intersection]  # noqa: UP007


@dc.dataclass
class PathParameters:
    """The path.

    Attributes:
        shape: Position, a shape by its tag, such as ``!Circle``.
        orientation: Orientation; without keyframes the waypoint file's, or none.
    """

    shape: PathShape = dc.field(default_factory=BentLemniscate)
    orientation: OrientationParameters = dc.field(default_factory=OrientationParameters)


@dc.dataclass
class SurfaceParameters:
    """The surface.

    Attributes:
        shape: Position, a shape by its tag, such as ``!Cylinder``.
        orientation: Orientation.
    """

    shape: SurfaceShape = dc.field(default_factory=Paraboloid)
    orientation: SurfaceOrientationParameters = dc.field(
        default_factory=SurfaceOrientationParameters
    )
