"""The path of a scenario."""

import math
from dataclasses import replace
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
from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    Curve,
    Edge,
    FourierCurve,
    OrientationCurve,
    Path,
    PiecewisePolynomialCurve,
    Tolerance,
    WaypointTable,
    find_edge,
    find_edges,
    interpolate_orientation,
    matrix_to_quaternion,
    path_from_waypoints,
    quaternion_to_matrix,
    read_waypoints,
    rotation_to_axis,
)
from pfsc_drake.geometry.files.unit import Unit
from pfsc_drake.geometry.paths.path_warnings import far_waypoints, turning_back
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.geometry.rotation import EULER_TO_QUATERNION, rotation_vector_to_quaternion
from pfsc_drake.geometry.surfaces.surface import Surface

_KEYFRAMES = "path.orientation.keyframes: [{angles_deg: [0, 0, 0]}], one being kept everywhere"


def _give_orientation(path: Path) -> str:
    """Return how a path gets an orientation."""
    columns = "columns zyx_deg_1, zyx_deg_2, zyx_deg_3 of the waypoint file, or "
    return f"give the orientation too: {columns if path.waypoints else ''}{_KEYFRAMES}"


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
        path = Path(path.position, waypoints=path.waypoints, notes=path.notes)
    if task in ("tool_axis", "yaw") and path.orientation is None:
        raise InputError(
            f"path.orientation.task = {task}: the path has no orientation; "
            f"{_give_orientation(path)}"
        )
    if parameters.orientation.jacobian == "analytic" and path.orientation is None:
        raise InputError(
            f"path.orientation.jacobian = analytic: the path has no orientation; "
            f"{_give_orientation(path)}"
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
        ways = [_give_orientation(path), "if none is meant, write path.orientation.task: none"]
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
    table = read_waypoints(folder / shape.file, progress, cast(Unit, shape.unit))
    if table.yaw_alone:
        table = _with_tilt(table, parameters.orientation, shape.file)
        keyframes = []
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
        if hint is None and len(table.positions) == 2:
            start, end = (np.round(point, 6).tolist() for point in table.positions)
            hint = f"for a straight line write path.shape: !Line {{start: {start}, end: {end}}}"
        if hint is None and 2 < len(table.positions) < smoothness_made + 2:
            hint = (
                f"add waypoints to {shape.file}, or write path.shape.corner_distance (m) for "
                "straight lines with rounded corners"
            )
        # a path of straight lines says itself where it turns
        if hint is None and not (shape.corner_distance or shape.tolerance):
            hint = turning_back(table.positions)
        said = str(error)
        # keys name themselves
        place = "" if said.startswith("path.") else f"{shape.file}: "
        raise InputError("; ".join(filter(None, [f"{place}{said}", hint]))) from None
    if not keyframes:
        return path
    orientation = _orientation(parameters.orientation, path.position, smoothness)
    return Path(path.position, orientation, waypoints=path.waypoints, notes=path.notes)


def _with_tilt(
    table: WaypointTable, orientation: OrientationParameters, file: str
) -> WaypointTable:
    """Return waypoints whose turn alone is given, with the tilt that a keyframe gives."""
    if orientation.task not in ("yaw", "none"):
        raise InputError(
            f"{file}: column yaw alone, with path.orientation.task = {orientation.task}; roll and "
            "pitch besides, or path.orientation.task: yaw, are required"
        )
    if len(orientation.keyframes) > 1:
        raise InputError(
            f"path.orientation.keyframes: {len(orientation.keyframes)} given, and {file} has a "
            "column of yaw; at most one, the tool's tilt, is allowed"
        )
    assert table.quaternions is not None
    half = np.arctan2(table.quaternions[:, 3], table.quaternions[:, 0])
    axis = rotation_to_axis(orientation.yaw_axis)[:, 0]
    turns = quaternion_to_matrix(rotation_vector_to_quaternion(2.0 * half[:, None] * axis))
    angles = [keyframe.angles_deg for keyframe in orientation.keyframes] or [[0.0, 0.0, 0.0]]
    tilt = quaternion_to_matrix(EULER_TO_QUATERNION[orientation.convention](np.deg2rad(angles))[0])
    return replace(table, quaternions=matrix_to_quaternion(turns @ tilt), yaw_alone=False)


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
