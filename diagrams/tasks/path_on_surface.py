"""The path of a scenario, where it lies on the scenario's surface."""

from pathlib import Path as FilePath
from typing import cast

import numpy as np

from diagrams.scenario import OnSurface, PathParameters, SurfaceParameters
from diagrams.scenario.surface import SurfaceOrientationParameters
from diagrams.tasks.surface import given_quaternion, make_surface, normal_offset
from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import Curve, OrientationCurve, Path, read_waypoints
from pfsc_drake.geometry.files.unit import Unit
from pfsc_drake.geometry.path_on_surface import (
    curve_through,
    normal_orientation,
    path_on_surface,
    project_waypoints,
)
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.geometry.surfaces.surface import Surface


def surface_of_path(
    path: PathParameters, surface: SurfaceParameters | None
) -> SurfaceParameters | None:
    """Return the surface that a path lies on, or None if it lies on none.

    Args:
        path: The path.
        surface: The surface, if there is one.

    Raises:
        InputError: If the path is on a surface and there is none, or both say the orientation.
    """
    if not isinstance(path.shape, OnSurface):
        return None
    if surface is None:
        raise InputError(
            "path.shape = !OnSurface: there is no surface; write surface: {shape: !Plane {..}}"
        )
    said = path.orientation
    if said.keyframes or said.task != "full" or said.jacobian != "geometric":
        raise InputError(
            "path.orientation: given, and a path on a surface takes surface.orientation: "
            "{kind: none|given|normal, task: full|tool_axis|yaw}; leave out path.orientation"
        )
    return surface


def make_path_on_surface(
    said: PathParameters,
    parameters: SurfaceParameters,
    law: str,
    folder: FilePath,
    progress: Progress | None = None,
) -> Path:
    """Return a path on a surface, smooth enough for the law.

    Args:
        said: What the scenario says of the path; its shape is :class:`OnSurface`.
        parameters: What it says of the surface.
        law: Key of ``RELATIVE_DEGREE``, r; decides the class C^(r+1) of splines.
        folder: Where relative file names start.
        progress: Told the fraction done and what is done, where that takes its time.

    Raises:
        InputError: If surface or path cannot be made, or are not smooth enough.
    """
    shape, smoothness = said.shape, RELATIVE_DEGREE[law] + 1
    assert isinstance(shape, OnSurface)
    if bool(shape.thetas) == bool(shape.file):
        raise InputError(
            f"path.shape = !OnSurface: {'both' if shape.file else 'neither'} of thetas and file; "
            "write thetas: [[theta_1, theta_2], ..] or file: NAME"
        )
    try:
        made = make_surface(parameters.shape, law, folder, progress)
    except InputError as error:
        raise InputError(f"surface.shape: {error}") from None
    surface, notes = made.surface, made.notes
    thetas = np.array(shape.thetas)
    try:
        if shape.file:
            table = read_waypoints(folder / shape.file, progress, cast(Unit, shape.unit))
            notes = (*notes, *table.notes)
            thetas = project_waypoints(
                surface, table.positions, shape.max_distance, closed=shape.closed
            )
        curve = curve_through(surface, thetas, smoothness=smoothness, closed=shape.closed)
        orientation = _orientation(parameters.orientation, surface, curve, smoothness)
        path = path_on_surface(surface, curve, orientation, notes)
    except InputError as error:
        raise InputError(f"path.shape: {error}") from None
    path.require_smoothness(smoothness, f"the law '{law}'")
    return path


def _orientation(
    said: SurfaceOrientationParameters, surface: Surface, curve: Curve, smoothness: int
) -> OrientationCurve | None:
    """Return the orientation along a curve of parameters, or None if it is no task."""
    quaternion = given_quaternion(said)
    if quaternion is not None:
        return OrientationCurve.fixed(quaternion, curve.domain)
    if said.kind == "none":
        return None
    return normal_orientation(surface, curve, normal_offset(said), smoothness=smoothness)
