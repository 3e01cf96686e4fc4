"""Closest point of a curved boundary: pieces with lower bounds of distance, and a tree of them."""

import heapq
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

import casadi as ca
import numpy as np
from scipy.ndimage import maximum_filter

# Pieces on each side of a closest point that are excluded from having another one, ...
BLOCK = 2
# ... and their largest extent in radii of one.
_BLOCK_EXTENT = 2.0 * BLOCK + 1.0
# Nearer by less than this is not nearer, m.
NOT_NEARER = 1e-12


@dataclass(frozen=True)
class Pieces:
    """Pieces of a boundary, in the order of its parameters.

    Each lies within a distance, its sag, of a flat disc about its centre.

    Attributes:
        centre: Centres of the pieces on the boundary, [n_1, n_2, 3], m.
        normal: Unit normals of the discs, [n_1, n_2, 3].
        radius: Radius of the discs, [n_1, n_2], m.
        sag: [n_1, n_2], m.
        bends: Largest curvature of the boundary on a piece, towards its normal and away from it,
            [2, n_1, n_2], 1/m; negative where it bends the other way.
        closed: Whether the last piece of a direction is a neighbour of the first.
    """

    centre: np.ndarray
    normal: np.ndarray
    radius: np.ndarray
    sag: np.ndarray
    bends: np.ndarray
    closed: tuple[bool, bool]


class BoundaryPoint(Protocol):
    """Point of the boundary to which the distance is a local minimum."""

    @property
    def distance(self) -> float:
        """Distance to the boundary point, m."""

    @property
    def piece(self) -> tuple[int, int] | None:
        """Numbers of the piece it is on, or None if it is on a border."""

    @property
    def below(self) -> bool:
        """Whether the point is on the other side of the boundary than its normal there."""


PointType = TypeVar("PointType", bound=BoundaryPoint)


class _Leaf(NamedTuple):
    number: int
    x: float
    y: float
    z: float
    n_x: float
    n_y: float
    n_z: float
    radius: float
    sag: float


class _Ball(NamedTuple):
    number: int
    x: float
    y: float
    z: float
    radius: float


class ClosestBoundaryPoint(Generic[PointType]):
    """Closest point of a whole boundary, by branch and bound.

    Balls around groups of pieces, and the flat discs of single ones, bound the distance from below;
    Newton's method is started only on pieces that may be nearer than the best point found. Around
    a local minimum shorter than the radius of curvature there is no other one, so that the
    neighbouring pieces need not be tried.

    Args:
        pieces: All of the boundary.
        project: Local minimum near the middle of a piece, from a point, m, and the piece's row and
            column.
    """

    def __init__(
        self,
        pieces: Pieces,
        project: Callable[[float, float, float, int, int], PointType],
    ) -> None:
        self._project = project
        self._shape = pieces.radius.shape
        self._closed = pieces.closed
        self._alone = [alone_within(pieces, bend).ravel().tolist() for bend in pieces.bends]
        self._balls, self._leaves = _tree(pieces)

    def __call__(self, x: float, y: float, z: float) -> PointType:
        """Return the closest boundary point to a point, m."""
        balls, leaves, sqrt = self._balls, self._leaves, math.sqrt
        best: PointType | None = None
        # distance of a piece's centre, or of the closest point found
        least = math.inf
        shielded: list[tuple[int, int]] = []
        heap = [(0.0, len(balls) - 1, -1)]
        columns = self._shape[1]
        while heap:
            low, node, piece = heapq.heappop(heap)
            if best is not None and low >= best.distance - NOT_NEARER:
                break
            if piece >= 0:
                row, column = divmod(piece, columns)
                if any(self._beside(row, column, *other) for other in shielded):
                    continue
                closest_point = self._project(x, y, z, row, column)
                if best is None or closest_point.distance < best.distance:
                    best = closest_point
                    least = min(least, closest_point.distance)
                if closest_point.piece is not None:
                    index = closest_point.piece[0] * columns + closest_point.piece[1]
                    if closest_point.distance < self._alone[closest_point.below][index]:
                        shielded.append(closest_point.piece)
                continue
            for number, a, b, c, radius in balls[node]:
                a, b, c = x - a, y - b, z - c
                low = sqrt(a * a + b * b + c * c) - radius
                if low <= least:
                    heapq.heappush(heap, (low, number, -1))
            for number, a, b, c, u, v, w, radius, sag in leaves[node]:
                a, b, c = x - a, y - b, z - c
                square = a * a + b * b + c * c
                height = a * u + b * v + c * w
                aside = square - height * height
                aside = sqrt(aside) - radius if aside > radius * radius else 0.0
                low = sqrt(height * height + aside * aside) - sag
                if low <= least:
                    heapq.heappush(heap, (low, -1, number))
                    away = sqrt(square)
                    if away < least:
                        least = away
        assert best is not None
        return best

    def _beside(self, row: int, column: int, block_row: int, block_column: int) -> bool:
        """Return whether a piece is within the block around another one."""
        rows, columns = self._shape
        apart, across = abs(row - block_row), abs(column - block_column)
        if self._closed[0]:
            apart = min(apart, rows - apart)
        if self._closed[1]:
            across = min(across, columns - across)
        return apart <= BLOCK and across <= BLOCK


def _tree(pieces: Pieces) -> tuple[list[list[_Ball]], list[list[_Leaf]]]:
    """Return balls around ever larger blocks of neighbouring pieces.

    Returns:
        For each node the balls in it and the pieces in it, one of both empty; the last is the root.
    """
    shape = pieces.radius.shape
    sizes = np.stack([pieces.radius, pieces.sag], axis=-1)
    rows = np.concatenate([pieces.centre, pieces.normal, sizes], axis=-1)
    within: list[Any] = [
        _Leaf(i, *row) for i, row in enumerate(rows.reshape(-1, rows.shape[-1]).tolist())
    ]
    balls: list[list[_Ball]] = []
    leaves: list[list[_Leaf]] = []
    stride, blocks = (1, 1), shape
    while len(within) > 1 or not balls:
        wider = _wider(pieces.centre, _wider(pieces.centre, stride))
        first, number = len(balls), np.arange(len(within)).reshape(blocks)
        step = (wider[0] // stride[0], wider[1] // stride[1])
        stride = wider
        centre, radius = _balls(pieces, stride)
        blocks = radius.shape
        for row, column in np.ndindex(blocks):
            part = number[
                row * step[0] : (row + 1) * step[0], column * step[1] : (column + 1) * step[1]
            ]
            members = [within[i] for i in part.ravel().tolist()]
            balls.append(members if first else [])
            leaves.append([] if first else members)
        rows = np.concatenate([centre, radius[..., None]], axis=-1).reshape(-1, 4)
        within = [_Ball(first + i, *row) for i, row in enumerate(rows.tolist())]
    return balls, leaves


def _wider(centre: np.ndarray, stride: tuple[int, int]) -> tuple[int, int]:
    """Return numbers of pieces along blocks that are twice as long where they are shorter."""
    extent = []
    for axis in (0, 1):
        chords = np.linalg.norm(np.diff(centre, axis=axis), axis=-1)
        several = stride[axis] < centre.shape[axis]
        extent.append(stride[axis] * float(chords.mean()) if several else math.inf)
    shorter = int(np.argmin(extent))
    return (2 * stride[0], stride[1]) if shorter == 0 else (stride[0], 2 * stride[1])


def _balls(pieces: Pieces, stride: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Return centres and radii of balls around blocks, [m_1, m_2, 3] and [m_1, m_2], m."""
    starts = [np.arange(0, n, k) for n, k in zip(pieces.radius.shape, stride, strict=True)]

    def over_blocks(function: np.ufunc, values: np.ndarray) -> np.ndarray:
        rows = function.reduceat(values, starts[0], axis=0)
        return np.asarray(function.reduceat(rows, starts[1], axis=1))

    middle = 0.5 * (over_blocks(np.minimum, pieces.centre) + over_blocks(np.maximum, pieces.centre))
    own = [np.arange(n) // k for n, k in zip(pieces.radius.shape, stride, strict=True)]
    away = np.linalg.norm(pieces.centre - middle[np.ix_(*own)], axis=-1)
    return middle, over_blocks(np.maximum, away + pieces.radius + pieces.sag)


def alone_within(pieces: Pieces, bends: np.ndarray) -> np.ndarray:
    """Return the distance below which a closest point is the only one of its block, [n_1, n_2], m.

    Along a geodesic f = |y - sigma|^2 / 2 has the second derivative 1 - (y - sigma) . n kappa, and
    (y - sigma) . n is at most the distance plus the sag of the block.

    Args:
        pieces: All of the boundary.
        bends: Curvature towards the side of the point, [n_1, n_2], 1/m.
    """
    modes = ["wrap" if closed else "nearest" for closed in pieces.closed]
    size = 2 * BLOCK + 1
    bend, most, radius = (
        maximum_filter(values, size=size, mode=modes)
        for values in (bends, np.abs(pieces.bends).max(axis=0), pieces.radius)
    )
    extent = _BLOCK_EXTENT * radius
    with np.errstate(divide="ignore"):
        return np.where(bend > 0.0, 1.0 / bend - 0.5 * most * extent**2, math.inf)


# Most pieces that Newton's method is started on; more are only needed where many local minima are
# equal to some parts of a thousand.
_MOST_TRIED = 8
# Rows of a local minimum: its distance, the number of its piece, and whether the point is below.
DISTANCE, PIECE, BELOW = range(3)
ON_NO_PIECE = -1.0


def closest_boundary_point(pieces: Pieces, project: ca.Function) -> ca.Function:
    """Return the function ``point -> closest_point`` of all pieces of a boundary.

    It is the search of :class:`ClosestBoundaryPoint` without a tree: the bounds of all pieces are
    evaluated, and pieces that may be nearer than the best are tried in the order of their bounds.

    Args:
        pieces: All of the boundary; their numbers go along the second direction first.
        project: Local minimum near the middle of a piece, ``(point, number) -> minimum``, shape
            (k,): its distance [m]; the number of its piece, -1 on an end; whether the point is on
            the other side than the normal there; and any further quantities.

    Returns:
        The function; for a NaN or infinite point all values are NaN.
    """
    point = ca.MX.sym("point", 3)
    low = _bounds(pieces, point)
    best = ca.vertcat(math.inf, math.nan * ca.MX.ones(project.size1_out(0) - 1))
    try_next = _unless_done(_try_next(pieces, project))
    for _ in range(_MOST_TRIED):
        may_be_nearer = ca.mmin(low) < best[DISTANCE] - NOT_NEARER
        low, best = try_next(may_be_nearer, low, best, point)
    return ca.Function("nearest_foot", [point], [best], ["point"], ["foot"])


def _bounds(pieces: Pieces, point: ca.MX) -> ca.MX:
    """Return lower bounds of the distance of each piece, [n], m."""
    away = [_row(pieces.centre[..., k]) for k in range(3)]
    away = [point[k] - column for k, column in enumerate(away)]
    normal = [_row(pieces.normal[..., k]) for k in range(3)]
    square = away[0] ** 2 + away[1] ** 2 + away[2] ** 2
    height = away[0] * normal[0] + away[1] * normal[1] + away[2] * normal[2]
    beside = ca.sqrt(ca.fmax(square - height**2, 0.0)) - _row(pieces.radius)
    return ca.sqrt(height**2 + ca.fmax(beside, 0.0) ** 2) - _row(pieces.sag)


def _try_next(pieces: Pieces, project: ca.Function) -> ca.Function:
    """Return ``(low, best, point) -> (low, best)``, which tries the piece with the least bound.

    Pieces beside a minimum that is the only one of its block count as tried, too.
    """
    count = pieces.radius.size
    low, best = ca.MX.sym("low", count), ca.MX.sym("best", project.size1_out(0))
    point, numbers = ca.MX.sym("point", 3), _row(np.arange(float(count)))
    number = ca.mmin(ca.if_else(low <= ca.mmin(low), numbers, count - 1.0))
    found = project(point, number)
    piece = ca.fmax(found[PIECE], 0.0)
    above, below = (_row(alone_within(pieces, bend))[piece] for bend in pieces.bends)
    alone = ca.logic_and(
        found[PIECE] != ON_NO_PIECE, found[DISTANCE] < ca.if_else(found[BELOW], below, above)
    )
    done = ca.logic_or(numbers == number, ca.logic_and(alone, _beside(pieces, piece)))
    return ca.Function(
        "try_next",
        [low, best, point],
        [
            ca.if_else(done, math.inf, low),
            ca.if_else(found[DISTANCE] < best[DISTANCE], found, best),
        ],
    )


def _beside(pieces: Pieces, piece: ca.MX) -> ca.MX:
    """Return whether each piece is within the block around one, [n]."""
    row = ca.floor(piece / pieces.radius.shape[1])
    indices = row, piece - row * pieces.radius.shape[1]
    within = ca.MX(1.0)
    for index, of_each, count, closed in zip(
        indices,
        np.indices(pieces.radius.shape, dtype=float),
        pieces.radius.shape,
        pieces.closed,
        strict=True,
    ):
        if count > 1:
            apart = ca.fabs(_row(of_each) - index)
            if closed:
                apart = ca.fmin(apart, count - apart)
            within = ca.logic_and(within, apart <= BLOCK)
    return within


def _unless_done(advance: ca.Function) -> ca.Function:
    """Return ``(goes_on, low, best, point) -> (low, best)``, which skips finished searches."""
    arguments = advance.mx_in()
    stay = ca.Function("stay", arguments, arguments[:2])
    return ca.Function.if_else("try_next_unless_done", advance, stay)


def _row(values: np.ndarray) -> ca.MX:
    """Return one number for each piece, as a row."""
    return ca.MX(ca.DM(values.ravel()))
