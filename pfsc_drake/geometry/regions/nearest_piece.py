"""The nearest place of a boundary among all of its pieces, as an expression."""

import math

import casadi as ca
import numpy as np

from pfsc_drake.geometry.regions.pieces import BLOCK, NOT_NEARER, Pieces, alone_within

# Most pieces that Newton's method is started on; where it takes more, many feet are as near to
# some parts of a thousand.
_MOST_TRIED = 8
# Of what is known of a foot: its distance, the number of its piece, and whether the point is below.
DISTANCE, PIECE, BELOW = range(3)
ON_NO_PIECE = -1.0


def nearest_foot(pieces: Pieces, foot: ca.Function) -> ca.Function:
    """Function ``point -> foot`` of the nearest of all feet on the pieces of a boundary.

    As :class:`NearestFoot` finds it, but without a tree: the bounds of all pieces are evaluated,
    and those that may be nearer than what was found are tried in the order of their bounds.

    Args:
        pieces: All of the boundary; their numbers go along the second direction first.
        foot: Local minimum near the middle of a piece, ``(point, number) -> foot``, shape (k,): its
            distance [m]; the number of the piece it is on, -1 on an end; whether the point is on
            the other side than the normal there; and what else is wanted to be known.

    Returns:
        The function; of a point that is no number all is NaN.
    """
    point = ca.MX.sym("point", 3)
    low = _bounds(pieces, point)
    best = ca.vertcat(math.inf, math.nan * ca.MX.ones(foot.size1_out(0) - 1))
    try_next = _unless_done(_try_next(pieces, foot))
    for _ in range(_MOST_TRIED):
        may_be_nearer = ca.mmin(low) < best[DISTANCE] - NOT_NEARER
        low, best = try_next(may_be_nearer, low, best, point)
    return ca.Function("nearest_foot", [point], [best], ["point"], ["foot"])


def _bounds(pieces: Pieces, point: ca.MX) -> ca.MX:
    """Distance that each piece is not nearer than, [n], m."""
    away = [_row(pieces.centre[..., k]) for k in range(3)]
    away = [point[k] - column for k, column in enumerate(away)]
    normal = [_row(pieces.normal[..., k]) for k in range(3)]
    square = away[0] ** 2 + away[1] ** 2 + away[2] ** 2
    height = away[0] * normal[0] + away[1] * normal[1] + away[2] * normal[2]
    beside = ca.sqrt(ca.fmax(square - height**2, 0.0)) - _row(pieces.radius)
    return ca.sqrt(height**2 + ca.fmax(beside, 0.0) ** 2) - _row(pieces.sag)


def _try_next(pieces: Pieces, foot: ca.Function) -> ca.Function:
    """``(low, best, point) -> (low, best)``: the piece with the least bound has been tried.

    So have those beside a foot that is the only one of its block.
    """
    count = pieces.radius.size
    low, best = ca.MX.sym("low", count), ca.MX.sym("best", foot.size1_out(0))
    point, numbers = ca.MX.sym("point", 3), _row(np.arange(float(count)))
    number = ca.mmin(ca.if_else(low <= ca.mmin(low), numbers, count - 1.0))
    found = foot(point, number)
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
    """Which pieces are within the block around one, [n]."""
    row = ca.floor(piece / pieces.radius.shape[1])
    places = row, piece - row * pieces.radius.shape[1]
    within = ca.MX(1.0)
    for place, of_each, count, closed in zip(
        places,
        np.indices(pieces.radius.shape, dtype=float),
        pieces.radius.shape,
        pieces.closed,
        strict=True,
    ):
        if count > 1:
            apart = ca.fabs(_row(of_each) - place)
            if closed:
                apart = ca.fmin(apart, count - apart)
            within = ca.logic_and(within, apart <= BLOCK)
    return within


def _unless_done(advance: ca.Function) -> ca.Function:
    """``(goes_on, low, best, point) -> (low, best)``, which costs nothing when all is done."""
    given = advance.mx_in()
    stay = ca.Function("stay", given, given[:2])
    return ca.Function.if_else("try_next_unless_done", advance, stay)


def _row(values: np.ndarray) -> ca.MX:
    """One number for each piece."""
    return ca.MX(ca.DM(values.ravel()))
