"""The surface of a scenario."""

from pathlib import Path as FilePath
from typing import Any, Literal, cast

import numpy as np

from diagrams.scenario import OrientationParameters, SurfaceParameters
from diagrams.scenario.surface import NumberShape, SurfaceOrientationParameters, SurfaceShape
from diagrams.scenario.surface_files import Extruded, Fitted, Revolved
from diagrams.scenario.surface_shapes import Cone, Cylinder, Paraboloid, Plane, Sphere, Torus
from diagrams.tasks.surface_files import MadeSurface, surface_from_file
from pfsc_drake.control.law.linearization import RELATIVE_DEGREE
from pfsc_drake.control.manifolds.manifold import Manifold
from pfsc_drake.control.manifolds.surface import SurfaceManifold
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    quaternion_to_matrix,
    rotation_to_axis,
    zyx_to_quaternion,
    zyz_to_quaternion,
)
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.geometry.surfaces.shapes import (
    Pair,
    Turned,
    cone,
    cylinder,
    paraboloid,
    plane,
    sphere,
    torus,
)
from pfsc_drake.geometry.surfaces.sheets import check_single_sheet
from pfsc_drake.geometry.surfaces.surface import Surface

_EULER = {"zyx": zyx_to_quaternion, "zyz": zyz_to_quaternion}


def make_surface(
    shape: SurfaceShape, law: str, folder: FilePath, progress: Progress | None = None
) -> MadeSurface:
    """Return a surface, smooth enough for the law and a single sheet.

    Args:
        shape: What the scenario says.
        law: Key of ``RELATIVE_DEGREE``, r; decides the class C^(r+1) that is needed.
        folder: Where relative file names start.
        progress: Told the fraction done and what is done, where that takes its time.

    Raises:
        InputError: If the surface cannot be made, or is not smooth enough.
    """
    needed = RELATIVE_DEGREE[law] + 1
    made = surface_from_shape(shape, needed, folder, progress)
    if made.surface.smoothness < needed:
        raise InputError(
            f"smoothness: class C^{made.surface.smoothness:g}, and the law '{law}' needs "
            f"C^{needed}; write smoothness: 0 for what the law needs"
        )
    check_single_sheet(made.surface)
    return made


def surface_from_shape(
    shape: SurfaceShape, smoothness: int, folder: FilePath, progress: Progress | None = None
) -> MadeSurface:
    """Return a surface, whatever its class.

    Args:
        shape: What the scenario says.
        smoothness: k of the class C^k that one from a file gets, unless the scenario says another.
        folder: Where relative file names start.
        progress: See :func:`make_surface`.

    Raises:
        InputError: If the surface cannot be made.
    """
    if isinstance(shape, Fitted | Revolved | Extruded):
        return surface_from_file(shape, smoothness, folder, progress)
    return MadeSurface(_from_numbers(shape))


def _from_numbers(shape: NumberShape) -> Surface:
    rotation = shape.rotation
    if isinstance(shape, Plane | Paraboloid):
        size = (_pair(shape.first), _pair(shape.second))
        if isinstance(shape, Plane):
            return plane(size, shape.origin, rotation)
        return paraboloid(size, shape.coefficient, shape.origin, rotation)
    angles = _pair(np.deg2rad(shape.angles_deg)) if shape.angles_deg else None
    turned = Turned(shape.origin, rotation, angles, shape.inward)
    if isinstance(shape, Cylinder):
        return cylinder(shape.radius, _pair(shape.heights), turned)
    if isinstance(shape, Cone):
        return cone(float(np.deg2rad(shape.opening_deg)), _pair(shape.distances), turned)
    if isinstance(shape, Sphere):
        return sphere(shape.radius, _pair(np.deg2rad(shape.latitudes_deg)), turned)
    assert isinstance(shape, Torus)
    return torus(shape.ring_radius, shape.tube_radius, turned)


def given_quaternion(orientation: SurfaceOrientationParameters) -> np.ndarray | None:
    """Return the quaternion of an orientation that is the same everywhere, or None."""
    if orientation.kind != "given":
        return None
    return _EULER[orientation.convention](np.deg2rad([orientation.angles_deg]))[0]


def normal_offset(orientation: SurfaceOrientationParameters) -> np.ndarray:
    """Return the rotation of the tool away from the surface's frame, shape (3, 3)."""
    turn = _EULER[orientation.convention](np.deg2rad([orientation.angles_deg]))[0]
    return quaternion_to_matrix(turn)


def make_surface_manifold(order: int, parameters: SurfaceParameters) -> SurfaceManifold:
    """Return the manifold of a surface with its orientation.

    Args:
        order: Relative degree of the law.
        parameters: What the scenario says.

    Raises:
        InputError: If the law has no such order.
    """
    said = parameters.orientation
    kind = None if said.kind == "none" else cast(Literal["given", "normal"], said.kind)
    offset = normal_offset(said) if kind == "normal" else None
    return SurfaceManifold(order, orientation=kind, offset=offset, **followed_angles(said))


def followed_angles(
    orientation: OrientationParameters | SurfaceOrientationParameters,
) -> dict[str, Any]:
    """Return the axis of the tool, or that in the world, that alone follows, or whose angles do.

    Args:
        orientation: What the scenario says.

    Returns:
        ``tool_axis`` and ``yaw_axis``, each of shape (3,) and length one, or None; ``euler``, the
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


def require_joints(manifold: Manifold, num_joints: int) -> None:
    """Refuse a robot with fewer joints than a surface, or a path on it, has coordinates.

    Args:
        manifold: The manifold.
        num_joints: Of the robot.

    Raises:
        InputError: If it has.
    """
    names = [coordinate.name for coordinate in manifold.coordinates]
    if num_joints < len(names):
        raise InputError(
            f"surface: {num_joints} joints for {len(names)} outputs ({', '.join(names)}); "
            "surface.orientation.task: tool_axis needs 5, yaw 4, kind: none 3"
        )


def _pair(values: object) -> Pair:
    first, last = np.asarray(values, dtype=float)
    return float(first), float(last)
