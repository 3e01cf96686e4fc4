"""Checks of regions: admissibility of a start, and compatibility with each other."""

import math
from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.regions.moving import MovingRegion
from pfsc_drake.geometry.regions.region import Distance, Region, axes_along

Regions = Mapping[str, Region | MovingRegion]

# Points examined, and their largest distance from the start, m.
_SAMPLES = 64
_FAR = 0.5
# Distances that differ by less are the same, m.
_SAME = 1e-9
# Steps towards the admissible side, and how far beyond each boundary, m.
_MOST_STEPS, _BEYOND = 200, 1e-6
# Starts and steps of the search for common points of two boundaries, and pairs examined.
_STARTS, _STEPS, _MOST_PAIRS = 8, 30, 300
# Distance of a common point from both, and longest step to it, m.
_COMMON, _LONGEST = 1e-9, 0.3
# Distance beside it at which a gap is measured, m, and the gap's share of that in a wedge.
_BESIDE, _NARROW = 1e-3, 0.3
# Angle between normals that are nearly one, deg, and the square of a sine that is rounding.
_NEARLY_PARALLEL_DEG = 0.6
_PARALLEL = 1e-20


def refuse_forbidden_start(regions: Regions, start: ArrayLike, clock: float = 0.0) -> None:
    """Refuse a start on the forbidden side of a region.

    Args:
        regions: The regions by name.
        start: Tool point, [3], m.
        clock: Time of the regions' clock [s].

    Raises:
        InputError: It is; names the regions, the depths, and the nearest admissible point that a
            search found, if there is one.
    """
    y = np.asarray(start, dtype=float)
    depths = {name: _distance(region, y, clock)[0] for name, region in regions.items()}
    inside = {name: -h for name, h in depths.items() if h < 0.0}
    if not inside:
        return
    which = ", ".join(f"{depth * 1e3:.4g} mm deep in that of {n}" for n, depth in inside.items())
    found = _admissible_near(list(regions.values()), y, clock)
    if found is None:
        hint = "no admissible point was found near it: regions exclude each other there"
    else:
        away = float(np.linalg.norm(found - y)) * 1e3
        hint = f"{_text(found)} is admissible, {away:.4g} mm away"
    raise InputError(f"start {_text(y)} is in a forbidden region, {which}; {hint}")


def blocked_start(regions: Regions, start: ArrayLike, clock: float = 0.0) -> list[str]:
    """Report a start on the forbidden side of a region from which no admissible point is near.

    Args:
        regions: The regions by name.
        start: Tool point, [3], m.
        clock: Time of the regions' clock [s].

    Returns:
        A sentence if a search of 0.5 m around found no admissible point.
    """
    y = np.asarray(start, dtype=float)
    inside = [name for name, region in regions.items() if _distance(region, y, clock)[0] < 0.0]
    if not inside or _admissible_near(list(regions.values()), y, clock) is not None:
        return []
    return [
        f"start {_text(y)} is in that of {' and '.join(inside)}, and no admissible point was found"
        " near it: regions exclude each other there, and squeeze the tool"
    ]


def refuse_same_regions(regions: Regions, start: ArrayLike, clock: float = 0.0) -> None:
    """Refuse identical regions, and regions that exclude each other with one boundary.

    Two regions are compared by distances at 64 points around the start.

    Args:
        regions: The regions by name.
        start: Tool point, [3], m.
        clock: Time of the regions' clock [s].

    Raises:
        InputError: Two are the same, or one is the complement of the other.
    """
    points = _around(start, _SAMPLES)
    names = list(regions)
    table = np.array([[_distance(regions[n], y, clock)[0] for y in points] for n in names])
    for i, j in combinations(range(len(names)), 2):
        if abs(abs(table[i, 0]) - abs(table[j, 0])) > _SAME:
            continue
        if np.abs(table[i] - table[j]).max() < _SAME and not _moves(regions, names[i], names[j]):
            raise InputError(f"{names[i]} and {names[j]}: the same region; give it once")
        if np.abs(table[i] + table[j]).max() < _SAME:
            raise InputError(
                f"{names[i]} and {names[j]}: one boundary, with opposite sides admissible; must"
                " leave space between them"
            )


def tangent_regions(regions: Regions, start: ArrayLike, clock: float = 0.0) -> list[str]:
    """Return pairs of regions whose boundaries touch instead of crossing, near a start.

    Where they touch, their common admissible space is a wedge without an angle, or empty. Common
    points are searched from 8 points around the start, for the 300 pairs nearest to it; some may be
    overlooked.

    Args:
        regions: The regions by name.
        start: Tool point, [3], m.
        clock: Time of the regions' clock [s].

    Returns:
        A sentence for each pair: where, and which angle the normals make, below 0.6 deg or above
        179.4 deg; obstacles that stand on a boundary with a face do not count.
    """
    names = list(regions)
    away = {n: abs(_distance(regions[n], np.asarray(start, dtype=float), clock)[0]) for n in names}
    pairs = sorted(combinations(names, 2), key=lambda pair: max(away[pair[0]], away[pair[1]]))
    found = []
    starts = _around(start, _STARTS)
    for one, other in pairs[:_MOST_PAIRS]:
        for begin in starts:
            touching = _touching(regions[one], regions[other], begin, clock)
            if touching is not None:
                point, angle = touching
                found.append(
                    f"{one} and {other}: boundaries touch at {_text(point)},"
                    f" {angle:.2g} deg between their normals"
                )
                break
    return found


def _distance(region: Region | MovingRegion, point: np.ndarray, clock: float) -> Distance:
    x, y, z = point.tolist()
    if isinstance(region, MovingRegion):
        return region.distance_at(x, y, z, clock)
    return region.distance(x, y, z)


def _moves(regions: Regions, *names: str) -> bool:
    return any(isinstance(regions[name], MovingRegion) for name in names)


def _around(start: ArrayLike, count: int) -> np.ndarray:
    """Return points in a ball, the first being the start, [count, 3], m."""
    rng = np.random.default_rng(0)
    offsets = rng.normal(size=(count, 3))
    offsets *= (_FAR * rng.uniform(size=count) ** (1.0 / 3.0) / np.linalg.norm(offsets, axis=1))[
        :, None
    ]
    offsets[0] = 0.0
    return np.asarray(np.asarray(start, dtype=float) + offsets)


def _admissible_near(
    regions: Sequence[Region | MovingRegion], start: np.ndarray, clock: float
) -> np.ndarray | None:
    """Go out of the region that is deepest, again and again."""
    y = start.copy()
    for _ in range(_MOST_STEPS):
        h, *n = min(_distance(region, y, clock) for region in regions)
        if h >= 0.0:
            return y
        y = y + (_BEYOND - h) * np.array(n)
        if np.linalg.norm(y - start) > _FAR:
            return None
    return None


def _touching(
    one: Region | MovingRegion, other: Region | MovingRegion, begin: np.ndarray, clock: float
) -> tuple[np.ndarray, float] | None:
    """Return the point where two boundaries touch, and the angle between normals, deg.

    Newton's method to h = 0 of both, by the shortest steps; where boundaries touch each halves the
    distance.
    """
    y = begin
    for _ in range(_STEPS):
        (h_1, *n_1), (h_2, *n_2) = (_distance(region, y, clock) for region in (one, other))
        cosine = sum(a * b for a, b in zip(n_1, n_2, strict=True))
        square = sum((n_1[i - 2] * n_2[i - 1] - n_1[i - 1] * n_2[i - 2]) ** 2 for i in range(3))
        if max(abs(h_1), abs(h_2)) < _COMMON:
            angle = math.degrees(math.atan2(math.sqrt(square), cosine))
            if angle < _NEARLY_PARALLEL_DEG:
                return y, angle
            if angle > 180.0 - _NEARLY_PARALLEL_DEG and _narrows(one, other, y, n_1, clock):
                return y, angle
            return None
        # normals that differ by rounding lead neither to a common point nor to a step
        if square < _PARALLEL:
            return None
        step = (h_1 - cosine * h_2) / square * np.array(n_1)
        step += (h_2 - cosine * h_1) / square * np.array(n_2)
        y = y - step * min(1.0, _LONGEST / float(np.linalg.norm(step)))
    return None


def _narrows(
    one: Region | MovingRegion,
    other: Region | MovingRegion,
    point: np.ndarray,
    normal: Sequence[float],
    clock: float,
) -> bool:
    """Return whether the gap between two touching boundaries narrows to nothing at a point.

    It does not where an obstacle stands on a plane: there is no gap under it, a wide one beside it.
    """
    axes = axes_along(normal)
    widest = 0.0
    for angle in np.linspace(0.0, 2.0 * math.pi, 9)[:-1]:
        beside = point + _BESIDE * (math.cos(angle) * axes[0] + math.sin(angle) * axes[1])
        widest = max(widest, sum(_distance(region, beside, clock)[0] for region in (one, other)))
    return 10.0 * _COMMON < widest < _NARROW * _BESIDE


def _text(y: np.ndarray) -> str:
    return "[" + ", ".join(f"{value:.6g}" for value in y) + "] m"
