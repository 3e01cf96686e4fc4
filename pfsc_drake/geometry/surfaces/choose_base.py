"""The choice of the plane or cylinder over which scattered points are seen."""

import math
from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.surfaces.base import Base, CylinderBase, PlaneBase, axis_of_normals
from pfsc_drake.geometry.surfaces.coverage import Neighbourhoods


class Axis(NamedTuple):
    """Axis of a cylinder.

    Attributes:
        point: On it, [3], m.
        direction: Of any length, [3].
    """

    point: ArrayLike
    direction: ArrayLike


BaseChoice = Literal["auto", "plane", "cylinder"] | Axis

# Cosine of the angle between normals of points and of their base, one of fifty being steeper:
# a plane that is so good is taken, and none is that is worse.
_GOOD, _BEARABLE = 0.7, 0.25
_STEEPEST = 0.02
# Component of a normal from which on it points up or down.
_UPRIGHT = 0.1
# A fold is where points whose feet are neighbours are further apart along their normal than
# this many spacings and times the roughness; so many of all points make one.
_NEIGHBOURS = 6
_SPACINGS, _ROUGHNESSES = 1.5, 8.0
_FOLDED = 0.02


def choose_base(
    points: np.ndarray,
    near: Neighbourhoods,
    choice: BaseChoice,
    seen_from: ArrayLike | None,
    along: ArrayLike | None,
) -> Base:
    """Plane or cylinder over which points are a function of two parameters.

    Args:
        points: [n, 3], m.
        near: Their neighbourhoods.
        choice: "auto" takes the plane that the normals are nearest to, or where they lean away
            from it by more than 45 degrees the better of it and the cylinder whose axis they
            meet; or "plane",
            "cylinder", or a cylinder of the axis given.
        seen_from: A point on the side that the normal points to, [3], m. By default it points
            upwards on a plane, and outward on a cylinder.
        along: Direction that theta_1 leans to, on a plane.

    Raises:
        InputError: The points fold over in every base tried, or an unknown choice.
    """
    view = None if seen_from is None else _vector("seen_from", seen_from)

    def on_plane() -> Base:
        return _plane(points, near, view, along)

    def on_cylinder() -> Base:
        axis = choice if isinstance(choice, Axis) else Axis(*axis_of_normals(points, near.normals))
        return _cylinder(points, near, view, axis)

    made: dict[str, list[Callable[[], Base]]] = {
        "auto": [on_plane, on_cylinder],
        "plane": [on_plane],
        "cylinder": [on_cylinder],
    }
    kind = "cylinder" if isinstance(choice, Axis) else choice
    if kind not in made:
        raise InputError(
            f"surface base: '{choice}'; 'auto', 'plane', 'cylinder' or the axis of a cylinder is"
            " allowed"
        )
    best, failures = None, []
    for make in made[kind]:
        base = make()
        steepest = _steepest(base, points, near)
        fold = _fold(base, points, near)
        if fold is not None:
            failures.append(
                f"on {base.name} two sheets lie over each other near {_numbers(fold)} m"
            )
        elif steepest < _BEARABLE:
            lean = math.degrees(math.acos(steepest))
            failures.append(f"on {base.name} it leans over by {lean:.0f} deg")
        elif steepest >= _GOOD:
            return base
        elif best is None or steepest > best[0]:
            best = steepest, base
    if best is None:
        raise InputError(
            f"surface points: the patch folds over: {'; '.join(failures)}; fit a part of it, or"
            " give the axis of a cylinder that it is seen from as a single sheet"
        )
    return best[1]


def _plane(
    points: np.ndarray, near: Neighbourhoods, view: np.ndarray | None, along: ArrayLike | None
) -> Base:
    normal = np.linalg.eigh(near.normals.T @ near.normals)[1][:, 2]
    if view is not None:
        sense = normal @ (view - points.mean(axis=0))
    else:
        sense = normal[2] if abs(normal[2]) > _UPRIGHT else normal[int(np.argmax(np.abs(normal)))]
    return PlaneBase(points, normal if sense >= 0.0 else -normal, along)


def _cylinder(
    points: np.ndarray, near: Neighbourhoods, view: np.ndarray | None, axis: Axis
) -> Base:
    origin, direction = _vector("axis point", axis.point), _vector("axis direction", axis.direction)
    outward = CylinderBase(points, origin, direction, near.spacing)
    if view is None:
        return outward
    if outward.closed[0]:
        outside = bool(outward.heights(view[None])[0] >= 0.0)
    else:
        facing = np.sum(outward.normals(points) * (view - points), axis=1) > 0.0
        outside = bool(np.mean(facing) >= 0.5)
    if outside:
        return outward
    return CylinderBase(points, origin, direction, near.spacing, outward=False)


def _steepest(base: Base, points: np.ndarray, near: Neighbourhoods) -> float:
    """Cosine of the angle between normals of points and the base, one of fifty being smaller."""
    cosines = np.abs(np.sum(base.normals(points) * near.normals, axis=1))
    return float(np.quantile(cosines, _STEEPEST))


def _fold(base: Base, points: np.ndarray, near: Neighbourhoods) -> np.ndarray | None:
    """A point [3] where sheets lie over each other, if there are such."""
    theta = base.parameters(points)
    distances, indices = cKDTree(theta).query(theta, _NEIGHBOURS + 1)
    offsets = np.abs(np.einsum("nki,ni->nk", points[indices] - points[:, None], near.normals))
    allowed = np.maximum(_SPACINGS * near.spacing, _ROUGHNESSES * near.thickness)
    folded = np.any(offsets > np.maximum(distances, allowed), axis=1)
    if np.mean(folded) <= _FOLDED:
        return None
    return np.asarray(points[int(np.argmax(folded))])


def _vector(name: str, values: ArrayLike) -> np.ndarray:
    vector = np.asarray(values, dtype=float)
    if vector.shape != (3,) or not np.all(np.isfinite(vector)):
        raise InputError(f"{name}: {vector.tolist()}; 3 finite numbers are required")
    return vector


def _numbers(values: np.ndarray) -> str:
    return "[" + ", ".join(f"{value:.4g}" for value in values) + "]"
