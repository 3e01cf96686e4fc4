"""Shapes of paths: their common interface; lines, circles and the bent lemniscate."""

import dataclasses as dc
import math
from abc import ABC, abstractmethod
from typing import Annotated

from pfsc_drake.checks import require_length
from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.fourier_curve import FourierCurve
from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve
from pfsc_drake.geometry.paths.geometric_path import Path
from pfsc_drake.geometry.shapes.shape import ShapeInputs
from pfsc_drake.geometry.shapes.tool_orientation import OrientationParameters
from pfsc_drake.yaml.rules import Length, Numbers, Parameters, Point


class PathShape(ABC):
    """Shape that is a path by itself."""

    @abstractmethod
    def path(self, orientation: OrientationParameters, inputs: ShapeInputs) -> Path:
        """Return the path, with the orientation that it has.

        Args:
            orientation: Keyframes.
            inputs: Folder of files, and class of splines.

        Raises:
            InputError: If a file cannot be used, or defines no path.
        """


class CurveShape(PathShape):
    """A path that is a curve with keyframes of orientation along it."""

    @abstractmethod
    def curve(self, inputs: ShapeInputs) -> Curve:
        """Return the curve.

        Args:
            inputs: Folder of files, and class of splines.

        Raises:
            InputError: If no curve can be made.
        """

    def path(self, orientation: OrientationParameters, inputs: ShapeInputs) -> Path:
        """Return the path, with the orientation that it has."""
        curve = self.curve(inputs)
        return Path(curve, orientation.along(curve, inputs.smoothness))


@dc.dataclass
class Line(Parameters, CurveShape):
    """A straight path.

    Attributes:
        start: First point [m], at most 1e4 from the origin.
        end: Last point [m], at least 1e-4 from the first.
    """

    start: Point = dc.field(default_factory=lambda: [0.8, 0.0, 1.0])
    end: Point = dc.field(default_factory=lambda: [0.8, 0.3, 1.0])

    def __post_init__(self) -> None:
        super().__post_init__()
        require_length("distance of start and end", math.dist(self.start, self.end))

    def curve(self, inputs: ShapeInputs) -> Curve:
        """Return the curve."""
        return PiecewisePolynomialCurve.line(self.start, self.end)


@dc.dataclass
class Circle(Parameters, CurveShape):
    """A circular path ``center + radius (u cos theta + v sin theta)``.

    Attributes:
        center: Center [m], at most 1e4 from the origin.
        radius: Radius [m], 1e-4 to 1e4.
        axis_u: Direction of ``u``, of any length.
        axis_v: Direction in the plane of the circle, at least 0.1 deg from ``u``; ``v`` is
            its part perpendicular to ``u``. Both lengths are made one.
    """

    center: Point = dc.field(default_factory=lambda: [0.8, 0.0, 1.0])
    radius: Length = 0.15
    axis_u: Annotated[list[float], Numbers(3)] = dc.field(default_factory=lambda: [0.0, 1.0, 0.0])
    axis_v: Annotated[list[float], Numbers(3)] = dc.field(default_factory=lambda: [0.0, 0.0, 1.0])

    def curve(self, inputs: ShapeInputs) -> Curve:
        """Return the curve."""
        return FourierCurve.circle(self.center, self.radius, self.axis_u, self.axis_v)


@dc.dataclass
class BentLemniscate(CurveShape):
    """The vertically bent lemniscate (3.87)."""

    def curve(self, inputs: ShapeInputs) -> Curve:
        """Return the curve."""
        return FourierCurve.bent_lemniscate()
