"""The path of a scenario."""

import math
from pathlib import Path as FilePath
from typing import Literal, cast

import numpy as np

from diagrams.scenario import (
    BentLemniscate,
    Circle,
    Line,
    OrientationParameters,
    PathParameters,
    Waypoints,
)
from pfsc_drake.control.law.linearization import (
    RELATIVE_DEGREE,
)
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    Curve,
    FourierCurve,
    OrientationCurve,
    Path,
    PiecewisePolynomialCurve,
    Tolerance,
    interpolate_orientation,
    path_from_waypoints,
    read_waypoints,
    zyx_to_quaternion,
    zyz_to_quaternion,
)
from pfsc_drake.geometry.paths.smoothing import Progress

_EULER = {"zyx": zyx_to_quaternion, "zyz": zyz_to_quaternion}


def make_path(
    parameters: PathParameters, law: str, folder: FilePath, progress: Progress | None = None
) -> Path:
    """Return the path, smooth enough for the law.

    Args:
        parameters: What the scenario says.
        law: Key of ``RELATIVE_DEGREE``; decides the class C^(r+1) of splines.
        folder: Where relative file names start.
        progress: Told the fraction done and what is done, where that takes its time.

    Raises:
        InputError: If the path cannot be made or is not smooth enough.
    """
    smoothness = RELATIVE_DEGREE[law] + 1
    shape = parameters.shape
    if isinstance(shape, Waypoints):
        path = _through_waypoints(parameters, shape, smoothness, folder, progress)
    else:
        position = _position(shape)
        path = Path(position, _orientation(parameters.orientation, position, smoothness))
    path.require_smoothness(smoothness, f"the law '{law}'")
    return path


def require_orientation(path: Path, num_joints: int) -> None:
    """Refuse a path without orientation for a robot whose joints need one.

    Args:
        path: The path.
        num_joints: Of the robot.

    Raises:
        InputError: If six joints have no orientation to follow.
    """
    if num_joints == 6 and path.orientation is None:
        raise InputError(
            f"path: {num_joints} joints for 3 outputs (position only); give the orientation too: "
            "columns zyx_deg_1, zyx_deg_2, zyx_deg_3 of the waypoint file, or "
            "path.orientation.keyframes: [{angles_deg: [0, 0, 0]}], one being kept everywhere"
        )


def _through_waypoints(
    parameters: PathParameters,
    shape: Waypoints,
    smoothness: int,
    folder: FilePath,
    progress: Progress | None,
) -> Path:
    keyframes = parameters.orientation.keyframes
    table = read_waypoints(folder / shape.file, progress)
    if keyframes and table.quaternions is not None:
        raise InputError(
            f"path.orientation.keyframes: {len(keyframes)} given, and {shape.file} has columns "
            "of orientation too: leave out the keyframes or the columns"
        )
    tolerance = None
    if shape.tolerance > 0.0:
        tolerance = Tolerance(shape.tolerance, math.radians(shape.tolerance_deg))
    path = path_from_waypoints(
        table,
        smoothness=shape.smoothness or smoothness,
        closed=shape.closed,
        parametrization=cast(Literal["chord", "centripetal"], shape.parametrization),
        tolerance=tolerance,
        corner_distance=shape.corner_distance or None,
        progress=progress,
    )
    if not keyframes:
        return path
    orientation = _orientation(parameters.orientation, path.position, smoothness)
    return Path(path.position, orientation, waypoints=path.waypoints)


def _position(shape: BentLemniscate | Circle | Line) -> Curve:
    if isinstance(shape, Circle):
        return FourierCurve.circle(shape.center, shape.radius, shape.axis_u, shape.axis_v)
    if isinstance(shape, Line):
        return PiecewisePolynomialCurve.line(shape.start, shape.end)
    return FourierCurve.bent_lemniscate()


def _orientation(
    parameters: OrientationParameters, position: Curve, smoothness: int
) -> OrientationCurve | None:
    """Return the interpolated keyframes, or None if there are none."""
    keyframes = parameters.keyframes
    if not keyframes:
        return None
    to_quaternion = _EULER[parameters.convention]
    quaternions = to_quaternion(np.deg2rad([keyframe.angles_deg for keyframe in keyframes]))
    if len(keyframes) == 1:
        return OrientationCurve.fixed(quaternions[0], position.domain)
    begin, end = position.domain
    fractions = np.array([keyframe.theta for keyframe in keyframes])
    if position.closed:
        fractions = np.append(fractions, fractions[0] + 1.0)
        quaternions = np.vstack([quaternions, quaternions[:1]])
    span = fractions[-1] - fractions[0]
    if fractions[0] != 0.0 or not np.isclose(span, 1.0):
        raise InputError(
            f"orientation keyframes: theta runs from {fractions[0]:g} to {fractions[-1]:g}; "
            "it must run from 0 to 1 (on closed paths the first keyframe stands for 1 too)"
        )
    return interpolate_orientation(
        quaternions,
        begin + fractions * (end - begin),
        smoothness=smoothness,
        closed=position.closed,
    )
