"""Shapes of paths: what each of them offers."""

from abc import ABC, abstractmethod

from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.paths.path import Path
from pfsc_drake.geometry.shapes.shape import ShapeInputs
from pfsc_drake.geometry.shapes.tool_orientation import OrientationParameters


class PathShape(ABC):
    """A shape that is a path by itself, as a person writes it."""

    @abstractmethod
    def path(self, orientation: OrientationParameters, inputs: ShapeInputs) -> Path:
        """Return the path, with the orientation that it has.

        Args:
            orientation: Keyframes.
            inputs: Folder of files, and class of splines.

        Raises:
            InputError: If a file cannot be used, or no path be made.
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
