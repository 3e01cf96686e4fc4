"""The path of a scenario."""

import math
from pathlib import Path as FilePath
from typing import Literal, cast

import numpy as np

from diagrams.scenario import (
    BentLemniscate,
    Circle,
    Intersection,
    Line,
    OnSurface,
    OrientationParameters,
    PathParameters,
    Streamed,
    Waypoints,
)
from diagrams.tasks.surface import make_surface
from pfsc_drake.control.law.linearization import RELATIVE_DEGREE
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    Curve,
    Edge,
    FourierCurve,
    OrientationCurve,
    Path,
    PiecewisePolynomialCurve,
    Tolerance,
    find_edge,
    find_edges,
    interpolate_orientation,
    path_from_waypoints,
    read_waypoints,
)
from pfsc_drake.geometry.paths.path_warnings import far_waypoints, turning_back
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.geometry.rotation import EULER_TO_QUATERNION
from pfsc_drake.geometry.surfaces.surface import Surface

_GIVE_ORIENTATION = (
    "give the orientation too: columns zyx_deg_1, zyx_deg_2, zyx_deg_3 of the waypoint file, or "
    "path.orientation.keyframes: [{angles_deg: [0, 0, 0]}], one being kept everywhere"
)


def make_path(
    parameters: PathParameters, law: str, folder: FilePath, progress: Progress | None = None
) -> Path:
    """Return the path, smooth enough for the law, without an orientation that is no task.

    Args:
        parameters: What the scenario says; on a surface :func:`make_path_on_surface` makes it.
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
        assert not isinstance(shape, OnSurface | Streamed)
        if isinstance(shape, Intersection):
            position = make_edge(shape, law, folder, progress)
        else:
            position = _position(shape)
        path = Path(position, _orientation(parameters.orientation, position, smoothness))
    task = parameters.orientation.task
    if task == "none" and path.orientation is not None:
        path = Path(path.position, waypoints=path.waypoints)
    if task in ("tool_axis", "yaw") and path.orientation is None:
        raise InputError(
            f"path.orientation.task = {task}: the path has no orientation; {_GIVE_ORIENTATION}"
        )
    if parameters.orientation.jacobian == "analytic" and path.orientation is None:
        raise InputError(
            f"path.orientation.jacobian = analytic: the path has no orientation; "
            f"{_GIVE_ORIENTATION}"
        )
    path.require_smoothness(smoothness, f"the law '{law}'")
    return path


def require_orientation(path: Path, task: str, num_joints: int) -> None:
    """Refuse a path that asks for more than a robot's joints can do, or for less by oversight.

    Args:
        path: The path, from :func:`make_path`.
        task: ``path.orientation.task`` of the scenario.
        num_joints: Number of joints of the robot.

    Raises:
        InputError: If there are too few joints, or four or more that nothing tells to give up the
            orientation.
    """
    if path.orientation is None:
        num_outputs, outputs = 3, "position only"
    elif task == "tool_axis":
        num_outputs, outputs = 5, "position and direction of the tool's axis"
    elif task == "yaw":
        num_outputs, outputs = 4, "position and turn about the vertical"
    else:
        num_outputs, outputs = 6, "position and orientation"
    said = f"path: {num_joints} joints for {num_outputs} outputs ({outputs})"
    if num_joints < num_outputs:
        ways = ["3 joints follow a path without orientation, 6 one with"]
        if num_joints == 5:
            ways.append("5 the direction of an axis: write path.orientation.task: tool_axis")
        if num_joints in (4, 5):
            ways.append("4 a turn about the vertical: write path.orientation.task: yaw")
        if num_joints >= 3:
            ways.append("for a position only write path.orientation.task: none")
        raise InputError("; ".join([said, *ways]))
    if num_joints > 3 and path.orientation is None and task != "none":
        ways = [_GIVE_ORIENTATION, "if none is meant, write path.orientation.task: none"]
        if num_joints != 6:
            hold = f"hold {num_joints - 3} of them: robot.fixed_joints: {{NAME: VALUE}}"
            ways[-1] += f", or {hold}"
        raise InputError("; ".join([said, *ways]))


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
    smoothness_made = shape.smoothness or smoothness
    try:
        path = path_from_waypoints(
            table,
            smoothness=smoothness_made,
            closed=shape.closed,
            parametrization=cast(Literal["chord", "centripetal"], shape.parametrization),
            tolerance=tolerance,
            corner_distance=shape.corner_distance or None,
            progress=progress,
        )
    except InputError as error:
        hint = far_waypoints(table.positions)
        if hint is None and 2 < len(table.positions) < smoothness_made + 2:
            hint = (
                f"add waypoints to {shape.file}, or write path.shape.corner_distance (m) for "
                "straight lines with rounded corners"
            )
        # a path of straight lines says itself where it turns
        if hint is None and not (shape.corner_distance or shape.tolerance):
            hint = turning_back(table.positions)
        raise InputError("; ".join(filter(None, [str(error), hint]))) from None
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
    to_quaternion = EULER_TO_QUATERNION[parameters.convention]
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


def make_edge(
    shape: Intersection, law: str, folder: FilePath, progress: Progress | None = None
) -> Curve:
    """Return the edge in which two surfaces meet, smooth enough for the law.

    Args:
        shape: What the scenario says.
        law: Key of ``RELATIVE_DEGREE``, r; decides the class C^(r+1) of splines.
        folder: Where relative file names start.
        progress: Told the fraction done and what is done, where that takes its time.

    Raises:
        InputError: If a surface cannot be made, or they have no edge, or several and nothing
            tells which.
    """
    if len(shape.surfaces) != 2:
        raise InputError(
            "path.shape.surfaces: none given; must be 2, e.g. [!Plane {..}, !Sphere {..}]"
        )
    first, second = (_surface(shape, k, law, folder, progress) for k in range(len(shape.surfaces)))
    smoothness = RELATIVE_DEGREE[law] + 1
    try:
        if shape.near:
            return find_edge(
                first, second, near=shape.near, smoothness=smoothness, tolerance=shape.tolerance
            ).curve
        edges = find_edges(first, second, smoothness=smoothness, tolerance=shape.tolerance)
    except InputError as error:
        raise InputError(f"path.shape.{error}") from None
    if len(edges) > 1:
        places = ", ".join(_place(edge) for edge in edges)
        raise InputError(
            f"path.shape.near: none given, and the surfaces have {len(edges)} edges, through "
            f"{places}; must be a point, [x, y, z] in m, next to the one that is meant"
        )
    return edges[0].curve


def _surface(
    shape: Intersection, k: int, law: str, folder: FilePath, progress: Progress | None
) -> Surface:
    try:
        return make_surface(shape.surfaces[k], law, folder, progress).surface
    except InputError as error:
        raise InputError(f"path.shape.surfaces[{k}]: {error}") from None


def _place(edge: Edge) -> str:
    begin = edge.curve.derivatives(edge.curve.domain[0], 0)[0]
    return f"[{', '.join(f'{value:.4g}' for value in begin)}]"
