"""Straight moves of tangential coordinates from rest to rest, with any progress in time."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from pfsc_drake.control.planning.scaling_spline import ScalingSpline
from pfsc_drake.geometry import PiecewisePolynomialCurve

# duration of each ramp of a default move, relative to a cruise over the whole distance
_RAMP = 0.25
# order of contact between ramp and cruise
_SMOOTHER = 9
# share of the largest rate below which a rate counts as zero
_NONE = 1e-9


@dataclass(frozen=True)
class Move:
    """One move, ``eta(t) = begin + direction s(t)``.

    Attributes:
        begin: Initial coordinates [m], shape (d,).
        direction: Direction, scaled to a largest component of 1, shape (d,).
        progress: ``s(t)`` from 0 to its end [m], from rest to rest, of dimension 1, at times from
            0 on [s].
    """

    begin: np.ndarray
    direction: np.ndarray
    progress: PiecewisePolynomialCurve

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return float(self.progress.domain[1])

    def with_scaling(self, scaling: ScalingSpline, order: int, longest: float) -> "Move":
        """Return the move with a speed scaling applied, of class C^order.

        Args:
            scaling: Speed scaling over the time of this move.
            order: Order of continuity, up to 4.
            longest: Largest duration of a polynomial piece [s].
        """
        return replace(self, progress=scaling.apply_to(self.progress, order, longest))

    def slower(self, factor: float) -> "Move":
        """Return the move with all times multiplied by a factor."""
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
        order: Highest derivative that is continuous at rest, too.
    """
    state = motion.derivatives(motion.breakpoints, 1)
    speed = np.abs(state[:, 1]).max(axis=1)
    rests = state[speed <= _NONE * speed.max(), 0]
    moves = []
    for begin, end in pairwise(rests):
        distance = float(np.abs(end - begin).max())
        if distance > _NONE * np.abs(rests).max():
            moves.append(Move(begin, (end - begin) / distance, _from_rest_to_rest(distance, order)))
    return moves


def _from_rest_to_rest(distance: float, order: int) -> PiecewisePolynomialCurve:
    """Return two ramps and a cruise of 1 m/s between them."""
    time = np.polynomial.Polynomial([0.0, 1.0])
    # smoother where the cruise begins: a later scaling cannot remove a kink
    slope = time ** (order - 1) * (1.0 - time) ** _SMOOTHER
    ramp = slope.integ() / slope.integ()(1.0)
    long = _RAMP * distance
    rise = ramp(time / long).integ()
    cruise = distance - 2.0 * rise(long)
    parts = [rise, rise(long) + time, distance - rise(long - time)]
    terms = max(len(part.coef) for part in parts)
    table = [np.pad(part.coef, (0, terms - len(part.coef))) for part in parts]
    times = np.cumsum([0.0, long, cruise, long])
    return PiecewisePolynomialCurve(times, np.array(table)[:, :, None], known_smoothness=order)


def one_after_another(
    moves: Sequence[Move], dwell: float
) -> tuple[PiecewisePolynomialCurve, np.ndarray]:
    """Return the motion of all moves, and their initial times [s].

    Args:
        moves: At least one.
        dwell: Rest before the first and after every move [s].
    """
    terms = max(move.progress.coefficients.shape[1] for move in moves)
    times, tables, begins = [0.0], [], []

    def rest(point: np.ndarray) -> None:
        if dwell > 0.0:
            times.append(times[-1] + dwell)
            tables.append(np.pad(point[None, None, :], ((0, 0), (0, terms - 1), (0, 0))))

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
