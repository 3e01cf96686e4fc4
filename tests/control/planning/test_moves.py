"""Moves from rest to rest, with any progress."""

import numpy as np
import pytest

from pfsc_drake.control.law.reference import rest_to_rest, straight_lines
from pfsc_drake.control.planning.moves import one_after_another, straight_moves

DWELL = 0.2


@pytest.mark.parametrize("dwell", [0.0, DWELL])
def test_moves_of_a_motion(dwell):
    points = [0.4, 1.0, 1.0, 0.7]
    motion = rest_to_rest(points, velocity=0.5, acceleration=2.0, dwell=dwell)
    moves = straight_moves(motion, 4)
    assert [move.begin[0] for move in moves] == pytest.approx([0.4, 1.0])
    assert [move.direction[0] for move in moves] == [1.0, -1.0]
    ends = [move.progress.derivatives(move.duration, 4)[:, 0] for move in moves]
    assert np.allclose(ends, [[0.6, 0, 0, 0, 0], [0.3, 0, 0, 0, 0]], rtol=0, atol=1e-6)
    for move in moves:
        speed = move.progress.derivatives(np.linspace(0.0, move.duration, 200), 1)[:, 1]
        assert speed.min() > -1e-12 and speed.max() == pytest.approx(1.0)
        assert move.progress.first_discontinuity(4) is None


def test_one_after_another_with_rests():
    points = [[0.0, 0.1], [0.4, -0.1], [0.4, 0.5]]
    moves = straight_moves(straight_lines(points, 0.5, 2.0, DWELL), 4)
    motion, begins = one_after_another(moves, DWELL)
    assert motion.first_discontinuity(4) is None
    assert np.allclose(begins, [DWELL, 2 * DWELL + moves[0].duration])
    assert motion.domain[1] == pytest.approx(3 * DWELL + sum(move.duration for move in moves))
    inside = [0.5 * DWELL, begins[0] + moves[0].duration + 0.1, motion.domain[1] - 0.05]
    assert np.allclose(motion.derivatives(inside, 0)[:, 0], points, rtol=0, atol=1e-12)
    # along the straight line between two points
    x, y = motion.derivatives(begins[0] + np.linspace(0.0, moves[0].duration, 20), 0)[:, 0].T
    assert np.allclose(y, 0.1 - 0.5 * x, rtol=0, atol=1e-12)


def test_a_slower_move_is_the_same_later():
    (move,) = straight_moves(rest_to_rest([0.0, 0.5], velocity=1.0, acceleration=2.0), 4)
    slow, times = move.slower(1.25), np.linspace(0.0, move.duration, 30)
    before, after = move.progress.derivatives(times, 3), slow.progress.derivatives(1.25 * times, 3)
    expected = before / 1.25 ** np.arange(4.0)[:, None]
    assert np.all(np.abs(after - expected) <= 1e-9 * np.abs(expected).max(axis=0))
