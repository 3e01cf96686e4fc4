"""Path and surface of a scenario, smooth enough for a law, with checks of the robot's joints."""

from pathlib import Path as FilePath
from typing import Any, Literal, cast

from diagrams.scenario.manifolds import PathParameters, SurfaceParameters
from diagrams.scenario.streamed import Streamed
from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.control.manifolds.manifold import Manifold
from pfsc_drake.control.manifolds.surface import SurfaceManifold
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import Path, rotation_to_axis
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.geometry.shapes.on_surface import OnSurface
from pfsc_drake.geometry.shapes.shape import PlacedSurface, ShapeInputs, SurfaceResult
from pfsc_drake.geometry.shapes.tool_orientation import (
    OrientationParameters,
    SurfaceOrientationParameters,
)

_KEYFRAMES = "path.orientation.keyframes: [{angles_deg: [0, 0, 0]}], one for a constant orientation"


def make_path(
    parameters: PathParameters, law: str, folder: FilePath, progress: Progress | None = None
) -> Path:
    """Return the path, smooth enough for the law, without an orientation that is no task.

    Args:
        parameters: The path; not one on a surface, see :func:`make_path_on_surface`.
        law: Key of ``RELATIVE_DEGREE``; decides the class C^(r+1) of splines.
        folder: Base folder of relative file names.
        progress: Receives the fraction done and the name of the step, where that takes its time.

    Raises:
        InputError: If the path cannot be created or is not smooth enough.
    """
    assert not isinstance(parameters.shape, OnSurface | Streamed)
    inputs = _inputs(law, folder, progress)
    path = parameters.shape.path(parameters.orientation, inputs)
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
    path.require_smoothness(inputs.smoothness, inputs.needed_by)
    return path


def surface_of_path(
    path: PathParameters, surface: SurfaceParameters | None
) -> SurfaceParameters | None:
    """Return the surface that a path lies on, or None.

    Args:
        path: The path.
        surface: The surface, if there is one.

    Raises:
        InputError: If the path is on a surface and there is none, or both have an orientation.
    """
    if not isinstance(path.shape, OnSurface):
        return None
    if surface is None:
        raise InputError(
            "path.shape = !OnSurface: there is no surface; write surface: {shape: !Plane {..}}"
        )
    own = path.orientation
    if own.keyframes or own.task != "full" or own.jacobian != "geometric":
        raise InputError(
            "path.orientation: given, and a path on a surface takes surface.orientation: "
            "{kind: none|given|normal, task: full|tool_axis|yaw}; leave out path.orientation"
        )
    return surface


def make_path_on_surface(
    path: PathParameters,
    surface: SurfaceParameters,
    law: str,
    folder: FilePath,
    progress: Progress | None = None,
) -> Path:
    """Return a path on a surface, smooth enough for the law.

    Args:
        path: The path; its shape is :class:`OnSurface`.
        surface: The surface.
        law: Key of ``RELATIVE_DEGREE``, r; decides the class C^(r+1) of splines.
        folder: Base folder of relative file names.
        progress: Receives the fraction done and the name of the step, where that takes its time.

    Raises:
        InputError: If surface or path cannot be created, or are not smooth enough.
    """
    assert isinstance(path.shape, OnSurface)
    inputs = _inputs(law, folder, progress)
    result = path.shape.path_on(surface.shape, surface.orientation, inputs)
    result.require_smoothness(inputs.smoothness, inputs.needed_by)
    return result


def make_surface(
    shape: PlacedSurface, law: str, folder: FilePath, progress: Progress | None = None
) -> SurfaceResult:
    """Return a surface, smooth enough for the law and a single sheet.

    Args:
        shape: Shape of the scenario.
        law: Key of ``RELATIVE_DEGREE``, r; requires the class C^(r+1).
        folder: Base folder of relative file names.
        progress: Receives the fraction done and the name of the step, where that takes its time.

    Raises:
        InputError: If the surface cannot be created, or is not smooth enough.
    """
    return shape.smooth_sheet(_inputs(law, folder, progress))


def _inputs(law: str, folder: FilePath, progress: Progress | None) -> ShapeInputs:
    return ShapeInputs(folder, RELATIVE_DEGREE[law] + 1, f"the law '{law}'", progress)


def make_surface_manifold(order: int, parameters: SurfaceParameters) -> SurfaceManifold:
    """Return the manifold of a surface with its orientation.

    Args:
        order: Relative degree of the law.
        parameters: Parameters of the scenario.

    Raises:
        InputError: If no law has that order.
    """
    chosen = parameters.orientation
    kind = None if chosen.kind == "none" else cast(Literal["given", "normal"], chosen.kind)
    offset = chosen.offset if kind == "normal" else None
    return SurfaceManifold(order, orientation=kind, offset=offset, **followed_angles(chosen))


def followed_angles(
    orientation: OrientationParameters | SurfaceOrientationParameters,
) -> dict[str, Any]:
    """Return the part of the orientation that is followed: an axis, or Euler angles.

    Args:
        orientation: Orientation of the scenario.

    Returns:
        ``tool_axis``, an axis of the tool that alone is followed, and ``yaw_axis``, an axis in the
        world about which alone the tool turns, unit vectors of shape (3,) or None; ``euler``, the
        convention of Euler angles whose differences are the coordinates, or None.
    """
    none = isinstance(orientation, SurfaceOrientationParameters) and orientation.kind == "none"
    task = "none" if none else orientation.task
    axes = {"tool_axis": orientation.tool_axis, "yaw_axis": orientation.yaw_axis}
    chosen = {"tool_axis": "tool_axis", "yaw": "yaw_axis"}.get(task)
    euler = orientation.convention if orientation.jacobian == "analytic" else None
    return {"euler": euler} | {
        name: rotation_to_axis(axis)[:, 0] if name == chosen else None
        for name, axis in axes.items()
    }


def require_orientation(path: Path, task: str, num_joints: int) -> None:
    """Refuse a path with more outputs than joints, or with too few of them by oversight.

    Args:
        path: Path from :func:`make_path`.
        task: ``path.orientation.task`` of the scenario.
        num_joints: Number of joints of the robot.

    Raises:
        InputError: If there are too few joints, or four or more without an orientation and without
            ``task: none``.
    """
    if path.orientation is None:
        num_outputs, outputs = 3, "position only"
    elif task == "tool_axis":
        num_outputs, outputs = 5, "position and direction of the tool's axis"
    elif task == "yaw":
        num_outputs, outputs = 4, "position and turn about the vertical"
    else:
        num_outputs, outputs = 6, "position and orientation"
    counts = f"path: {num_joints} joints for {num_outputs} outputs ({outputs})"
    if num_joints < num_outputs:
        words = ["tool_axis (position and an axis of the tool)"] * (num_joints == 5)
        words += ["yaw (position and turn about the vertical)"] * (num_joints in (4, 5))
        words.append("none (position only)")
        allowed = f"path.orientation.task: {' or '.join(words)}"
        raise InputError(f"{counts}; allowed: {allowed if num_joints >= 3 else '3 joints or more'}")
    if num_joints > 3 and path.orientation is None and task != "none":
        advice = [_give_orientation(path), "if none is meant, write path.orientation.task: none"]
        if num_joints != 6:
            hold = f"hold {num_joints - 3} of them: robot.fixed_joints: {{NAME: VALUE}}"
            advice[-1] += f", or {hold}"
        raise InputError("; ".join([counts, *advice]))


def _give_orientation(path: Path) -> str:
    """Return advice to give a path an orientation."""
    columns = "columns zyx_deg_1, zyx_deg_2, zyx_deg_3 of the waypoint file, or "
    return f"give the orientation too: {columns if path.waypoints else ''}{_KEYFRAMES}"


def require_joints(manifold: Manifold, num_joints: int) -> None:
    """Refuse a robot with fewer joints than coordinates of a surface, or of a path on it.

    Args:
        manifold: The manifold.
        num_joints: Number of joints of the robot.

    Raises:
        InputError: If there are fewer joints.
    """
    names = [coordinate.name for coordinate in manifold.coordinates]
    if num_joints < len(names):
        raise InputError(
            f"surface: {num_joints} joints for {len(names)} outputs ({', '.join(names)}); "
            "surface.orientation.task: tool_axis needs 5, yaw 4, kind: none 3"
        )
