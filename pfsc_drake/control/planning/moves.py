"""Straight moves of tangential coordinates from rest to rest, at whatever progress."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from pfsc_drake.control.planning.pace_spline import PaceSpline
from pfsc_drake.geometry import PiecewisePolynomialCurve

# of the time of a cruise all the way, for each of the ramps of a move that nobody has planned
_RAMP = 0.25
# order of contact of a ramp with the cruise
_SMOOTHER = 9
# of the largest, below which a rate is none
_NONE = 1e-9


@dataclass(frozen=True)
class Move:
    """One move, ``eta(t) = begin + direction s(t)``.

    Attributes:
        begin: Where it begins [m], shape (d,).
        direction: By its largest component, shape (d,).
        progress: ``s(t)`` from 0 to its end [m], from rest to rest, of dimension 1, at times from
            0 on [s].
    """

    begin: np.ndarray
    direction: np.ndarray
    progress: PiecewisePolynomialCurve

    @property
    def duration(self) -> float:
        """How long it takes [s]."""
        return float(self.progress.domain[1])

    def at_pace(self, pace: PaceSpline, order: int, longest: float) -> "Move":
        """Return the move at another pace, of class C^order.

        Args:
            pace: The pace, over the time of this move.
            order: Up to 4.
            longest: Of its pieces [s].
        """
        return replace(self, progress=pace.applied_to(self.progress, order, longest))

    def slower(self, factor: float) -> "Move":
        """Return the move with all times longer by a factor."""
        table, old = self.progress.coefficients, self.progress
        powers = factor ** -np.arange(table.shape[1], dtype=float)
        curve = PiecewisePolynomialCurve(
            factor * old.breakpoints,
            table * powers[:, None],
            closed=False,
            known_smoothness=int(min(old.smoothness, table.shape[1])),
        )
        return replace(self, progress=curve)


def straight_moves(motion: PiecewisePolynomialCurve, order: int) -> list[Move]:
    """Return the moves of a motion along straight lines, at 1 m/s, of class C^order at rest.

    Args:
        motion: Tangential coordinates over time, at rest at the ends of every move.
        order: Up to which derivatives are continuous at rest, too.
    """
    state = motion.derivatives(motion.breakpoints, 1)
    speed = np.abs(state[:, 1]).max(axis=1)
    places = state[speed <= _NONE * speed.max(), 0]
    moves = []
    for begin, end in pairwise(places):
        way = float(np.abs(end - begin).max())
        if way > _NONE * np.abs(places).max():
            moves.append(Move(begin, (end - begin) / way, _from_rest_to_rest(way, order)))
    return moves


def _from_rest_to_rest(way: float, order: int) -> PiecewisePolynomialCurve:
    """Return two ramps and a cruise of 1 m/s between them."""
    time = np.polynomial.Polynomial([0.0, 1.0])
    # smoother where the cruise begins: what is planned on top cannot take a kink away
    slope = time ** (order - 1) * (1.0 - time) ** _SMOOTHER
    ramp = slope.integ() / slope.integ()(1.0)
    long = _RAMP * way
    rise = ramp(time / long).integ()
    cruise = way - 2.0 * rise(long)
    parts = [rise, rise(long) + time, way - rise(long - time)]
    terms = max(len(part.coef) for part in parts)
    table = [np.pad(part.coef, (0, terms - len(part.coef))) for part in parts]
    places = np.cumsum([0.0, long, cruise, long])
    return PiecewisePolynomialCurve(places, np.array(table)[:, :, None], known_smoothness=order)


def one_after_another(
    moves: Sequence[Move], dwell: float
) -> tuple[PiecewisePolynomialCurve, np.ndarray]:
    """Return the motion of all moves, and when each of them begins [s].

    Args:
        moves: At least one.
        dwell: Rest before the first and after every move [s].
    """
    terms = max(move.progress.coefficients.shape[1] for move in moves)
    times, tables, begins = [0.0], [], []

    def rest(place: np.ndarray) -> None:
        if dwell > 0.0:
            times.append(times[-1] + dwell)
            tables.append(np.pad(place[None, None, :], ((0, 0), (0, terms - 1), (0, 0))))

    rest(moves[0].begin)
    for move in moves:
        begins.append(times[-1])
        table = move.progress.coefficients * move.direction
        table[:, 0] += move.begin
        tables.append(np.pad(table, ((0, 0), (0, terms - table.shape[1]), (0, 0))))
        times += (begins[-1] + move.progress.breakpoints[1:]).tolist()
        rest(move.begin + move.direction * move.progress.derivatives(move.duration, 0)[0])
    smooth = min(int(min(move.progress.smoothness, terms)) for move in moves)
    motion = PiecewisePolynomialCurve(
        np.array(times), np.concatenate(tables), closed=False, known_smoothness=smooth
    )
    return motion, np.array(begins)
