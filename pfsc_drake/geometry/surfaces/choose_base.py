"""Plane or cylinder that scattered points are projected onto, and their coverage of it."""

import math
from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import Delaunay, cKDTree

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.surfaces.fit_bases import Base, CylinderBase, PlaneBase, axis_of_normals
from pfsc_drake.geometry.surfaces.parametric_surface import Interval

# Neighbours that define a normal; more while noise hides their plane.
_FEWEST, _MOST = 16, 256
# Thickness of a neighbourhood over its width that passes as a plane.
_FLAT = 0.2
# Number of the neighbour at whose distance a square of that size has one point.
_FOURTH = 4


class Neighbourhoods(NamedTuple):
    """Properties of scattered points near a surface.

    Attributes:
        spacing: Median distance between neighbouring points, m.
        normals: Unit normals of unknown sign, [n, 3].
        thickness: Median root mean square distance of points from the plane of their neighbours, m.
    """

    spacing: float
    normals: np.ndarray
    thickness: float


def neighbourhoods(points: np.ndarray) -> Neighbourhoods:
    """Evaluate the neighbours of each of more than 16 different points, [n, 3], m."""
    tree = cKDTree(points)
    count = _FEWEST
    while True:
        distances, indices = tree.query(points, min(count, len(points)))
        near = points[indices]
        near = near - near.mean(axis=1, keepdims=True)
        values, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", near, near) / near.shape[1])
        thickness, width = np.sqrt(np.maximum(np.median(values[:, :2], axis=0), 0.0))
        if thickness <= _FLAT * width or count >= min(_MOST, len(points)):
            break
        count *= 2
    return Neighbourhoods(
        float(np.median(distances[:, _FOURTH])), vectors[:, :, 0], float(thickness)
    )


_CELLS_PER_REACH = 6.0
_MOST_CELLS = 400


class Coverage(NamedTuple):
    """Coverage of a rectangle by points.

    Attributes:
        centres: theta_1 [n_1] and theta_2 [n_2] of cells of the rectangle.
        distances: Distance from the centre of each cell to the nearest point, [n_1, n_2], m.
    """

    centres: tuple[np.ndarray, np.ndarray]
    distances: np.ndarray

    @property
    def hole(self) -> tuple[np.ndarray, float]:
        """Centre [2] and radius, m, of the largest circle without points."""
        row, column = np.unravel_index(int(np.argmax(self.distances)), self.distances.shape)
        centre = np.array([self.centres[0][row], self.centres[1][column]])
        return centre, float(self.distances[row, column])

    def covered_rectangle(
        self, reach: float, domain: tuple[Interval, Interval], closed: bool
    ) -> tuple[Interval, Interval] | None:
        """Return the largest rectangle that is everywhere within ``reach`` of a point.

        Args:
            reach: m.
            domain: The whole rectangle.
            closed: Whether the whole interval of theta_1 is required.

        Returns:
            Its sides, or None if there is none.
        """
        inside = self.distances <= reach
        if closed:
            inside = np.broadcast_to(np.all(inside, axis=0), inside.shape)
        rows, columns = _largest_rectangle(inside)
        if rows[0] == rows[1]:
            return None
        first, second = (
            Interval(*(side.begin + side.length * np.array(part) / count).tolist())
            for side, part, count in zip(domain, (rows, columns), inside.shape, strict=True)
        )
        return first, second


def cover(
    theta: np.ndarray, domain: tuple[Interval, Interval], reach: float, *, closed: bool
) -> Coverage:
    """Return the coverage of a rectangle by points, on cells of a sixth of a reach.

    There are at most 400 x 400 cells.

    Args:
        theta: Parameters of points, lengths in m, [n, 2].
        domain: Sides of the rectangle.
        reach: Distance of interest, m.
        closed: Whether theta_1 is periodic.
    """
    counts = [
        min(_MOST_CELLS, math.ceil(_CELLS_PER_REACH * side.length / reach)) for side in domain
    ]
    first, second = (
        side.begin + side.length * (np.arange(count) + 0.5) / count
        for side, count in zip(domain, counts, strict=True)
    )
    begins = np.array([side.begin for side in domain])
    points = theta - begins
    if closed:
        points[:, 0] = np.mod(points[:, 0], domain[0].length)
    # A box of length zero means no periodicity.
    tree = cKDTree(points, boxsize=[domain[0].length if closed else 0.0, 0.0])
    cells = np.stack(np.meshgrid(first, second, indexing="ij"), axis=-1) - begins
    distances, _ = tree.query(cells)
    return Coverage((first, second), distances)


def stand(theta: np.ndarray) -> float:
    """Return the spacing of points, also of points on lines that are further apart.

    Args:
        theta: Parameters, lengths in m, [n, 2], not along one line.

    Returns:
        Longest side of the Delaunay triangle around a point of the area, median over the area, m;
        1.8 / sqrt(density) for random points.
    """
    corners = theta[Delaunay(theta).simplices]
    sides = corners - np.roll(corners, 1, axis=1)
    longest = np.linalg.norm(sides, axis=2).max(axis=1)
    areas = np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0])
    order = np.argsort(longest)
    below = np.cumsum(areas[order])
    return float(longest[order][np.searchsorted(below, 0.5 * below[-1])])


def _largest_rectangle(mask: np.ndarray) -> tuple[tuple[int, int], tuple[int, int]]:
    """Return rows and columns, each from and to, of the largest rectangle that is all true."""
    best, found = 0, ((0, 0), (0, 0))
    heights = np.zeros(mask.shape[1], dtype=int)
    for row, line in enumerate(mask):
        heights = np.where(line, heights + 1, 0)
        # Columns that wait for a lower one, with the first column of their height.
        waiting: list[tuple[int, int]] = []
        for column, height in enumerate([*heights.tolist(), 0]):
            begin = column
            while waiting and waiting[-1][1] >= height:
                begin, high = waiting.pop()
                if high * (column - begin) > best:
                    best = high * (column - begin)
                    found = ((row + 1 - high, row + 1), (begin, column))
            waiting.append((begin, height))
    return found


class Axis(NamedTuple):
    """Axis of a cylinder.

    Attributes:
        point: Point on it, [3], m.
        direction: Direction vector of any length, [3].
    """

    point: ArrayLike
    direction: ArrayLike


BaseChoice = Literal["auto", "plane", "cylinder"] | Axis

# Cosine of the angle between normals of points and of their base, one of fifty being steeper:
# a plane above the first is taken immediately, a base below the second is rejected.
_GOOD, _ACCEPTABLE = 0.7, 0.25
_STEEPEST = 0.02
# Component of a normal from which on it points up or down.
_UPRIGHT = 0.1
# Points with neighbouring projections form a fold if they are further apart along their normal than
# this many spacings and times the roughness; least share of such points.
_NEIGHBOURS = 6
_SPACINGS, _ROUGHNESSES = 1.5, 8.0
_FOLDED = 0.02
# Flying points: distance from the median of so many around, over the usual one, and their share.
_AROUND, _FLYING, _MOST_FLYING = 16, 4.0, 0.1


def _refuse_flying(points: np.ndarray, near: Neighbourhoods) -> None:
    """Refuse single points off all others, which would count as folds."""
    count = min(_AROUND, len(points))
    indices = cKDTree(points).query(points, count)[1]
    # points off the others are rare, so the median of those around one is not
    centres = np.median(points[indices], axis=1)
    usual = np.median(np.linalg.norm(points - centres, axis=1))
    away = np.linalg.norm(points - centres, axis=1)
    flying = np.flatnonzero(away > _FLYING * max(float(usual), near.spacing))
    if not 0 < len(flying) <= _MOST_FLYING * len(points):
        return
    worst = int(flying[np.argmax(away[flying])])
    raise InputError(
        f"surface points: {len(flying)} of {len(points)} stand apart from those around them, by up"
        f" to {away[worst]:.3g} m at {_numbers(points[worst])} m, and make the patch look folded:"
        " take flying points out of the scan"
    )


def choose_base(
    points: np.ndarray,
    near: Neighbourhoods,
    choice: BaseChoice,
    visible_from: ArrayLike | None,
    along: ArrayLike | None,
) -> Base:
    """Return the plane or cylinder over which points are a function of two parameters.

    Args:
        points: [n, 3], m.
        near: Their neighbourhoods.
        choice: "auto" takes the plane that fits the normals best, or, where they lean away
            from it by more than 45 degrees, the better of it and the cylinder whose axis they
            meet; or "plane", "cylinder", or the axis of a cylinder.
        visible_from: A point on the side that the normal points to, [3], m. By default it points
            upwards on a plane, and outward on a cylinder.
        along: Direction that theta_1 leans to, on a plane.

    Raises:
        InputError: The points fold over in every base tried, or an unknown choice.
    """
    view = None if visible_from is None else _vector("visible_from", visible_from)

    def on_plane() -> Base:
        return _plane(points, near, view, along)

    def on_cylinder() -> Base:
        axis = choice if isinstance(choice, Axis) else Axis(*axis_of_normals(points, near.normals))
        return _cylinder(points, near, view, axis)

    candidates: dict[str, list[Callable[[], Base]]] = {
        "auto": [on_plane, on_cylinder],
        "plane": [on_plane],
        "cylinder": [on_cylinder],
    }
    kind = "cylinder" if isinstance(choice, Axis) else choice
    if kind not in candidates:
        raise InputError(
            f"surface base: '{choice}'; 'auto', 'plane', 'cylinder' or the axis of a cylinder is"
            " allowed"
        )
    best, failures = None, []
    for make in candidates[kind]:
        base = make()
        steepest = _steepest(base, points, near)
        fold = _fold(base, points, near)
        if fold is not None:
            failures.append(
                f"on {base.name} two sheets lie over each other near {_numbers(fold)} m"
            )
        elif steepest < _ACCEPTABLE:
            lean = math.degrees(math.acos(steepest))
            failures.append(f"on {base.name} it leans over by {lean:.0f} deg")
        elif steepest >= _GOOD:
            return base
        elif best is None or steepest > best[0]:
            best = steepest, base
    if best is None:
        _refuse_flying(points, near)
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
    """Return the cosine of the angle between normals of points and base, its 2 % quantile."""
    cosines = np.abs(np.sum(base.normals(points) * near.normals, axis=1))
    return float(np.quantile(cosines, _STEEPEST))


def _fold(base: Base, points: np.ndarray, near: Neighbourhoods) -> np.ndarray | None:
    """Return a point [3] where sheets lie over each other, or None."""
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
