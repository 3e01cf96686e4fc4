"""Paths on a surface."""

import dataclasses as dc
from typing import Annotated, cast

import numpy as np

from pfsc_drake.checks import FARTHEST, require
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.orientation_curve import OrientationCurve
from pfsc_drake.geometry.files.number_table import UNITS, Unit
from pfsc_drake.geometry.path_on_surface import (
    curve_through,
    normal_orientation,
    path_on_surface,
    project_waypoints,
)
from pfsc_drake.geometry.paths.geometric_path import Path
from pfsc_drake.geometry.paths.waypoints import read_waypoints
from pfsc_drake.geometry.shapes.shape import PlacedSurface, ShapeInputs
from pfsc_drake.geometry.shapes.tool_orientation import SurfaceOrientationParameters
from pfsc_drake.geometry.surfaces.parametric_surface import Surface
from pfsc_drake.yaml.fields import FILE
from pfsc_drake.yaml.rules import OneOf, Pair, Parameters, Range


@dc.dataclass
class OnSurface(Parameters):
    """A path on the scenario's ``surface``, whose transversal coordinates are normal and sideways.

    Its orientation is ``surface.orientation``. It is a spline through waypoints, given either by
    the surface's parameters or by points in space.

    Attributes:
        thetas: Waypoints ``[theta_1, theta_2]``; two are joined by a straight line in the
            parameters. In closed directions of the surface they may exceed a period.
        file: CSV file with columns ``x, y, z`` instead, relative to the scenario's folder;
            the path goes through their closest points on the surface.
        unit: Unit of ``x, y, z``: ``m``, ``cm``, ``mm``, ``inch``.
        max_distance: Largest distance of these points from the surface [m].
        closed: Whether the path is closed.
    """

    thetas: list[Pair] = dc.field(default_factory=list)
    file: str = dc.field(default="", metadata=FILE)
    unit: Annotated[str, OneOf(tuple(UNITS))] = "m"
    max_distance: Annotated[float, Range(0.0, FARTHEST, "m", open=True)] = 1e-3
    closed: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        require(bool(self.file) or self.unit == "m", "unit", self.unit, "m without a file")

    def path_on(
        self,
        shape: PlacedSurface,
        orientation: SurfaceOrientationParameters,
        inputs: ShapeInputs,
    ) -> Path:
        """Return the path on a surface.

        Args:
            shape: The surface.
            orientation: Orientation of the tool.
            inputs: Folder of files, and class of splines.

        Raises:
            InputError: If surface or path cannot be created, or are not smooth enough.
        """
        if bool(self.thetas) == bool(self.file):
            raise InputError(
                f"path.shape = !OnSurface: {'both' if self.file else 'neither'} of thetas and "
                "file; write thetas: [[theta_1, theta_2], ..] or file: NAME"
            )
        try:
            result = shape.smooth_sheet(inputs)
        except InputError as error:
            raise InputError(f"surface.shape: {error}") from None
        surface, notes, smoothness = result.surface, result.notes, inputs.smoothness
        thetas = np.array(self.thetas)
        try:
            if self.file:
                file = inputs.folder / self.file
                table = read_waypoints(file, inputs.progress, cast(Unit, self.unit))
                notes = (*notes, *table.notes)
                thetas = project_waypoints(
                    surface, table.positions, self.max_distance, closed=self.closed
                )
            curve = curve_through(surface, thetas, smoothness=smoothness, closed=self.closed)
            along = _orientation(orientation, surface, curve, smoothness)
            return path_on_surface(surface, curve, along, notes)
        except InputError as error:
            raise InputError(f"path.shape: {error}") from None


def _orientation(
    parameters: SurfaceOrientationParameters, surface: Surface, curve: Curve, smoothness: int
) -> OrientationCurve | None:
    """Return the orientation along a curve of parameters, or None if it is no task."""
    if parameters.quaternion is not None:
        return OrientationCurve.fixed(parameters.quaternion, curve.domain)
    if parameters.kind == "none":
        return None
    return normal_orientation(surface, curve, parameters.offset, smoothness=smoothness)
