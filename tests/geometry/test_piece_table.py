"""Look-up of polynomials against numpy."""

import math

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.geometry.curves.polynomial import PieceTable

RNG = np.random.default_rng(3)
BREAKS = np.cumsum(RNG.uniform(0.1, 1.0, 6))
TABLE = RNG.normal(size=(5, 4, 8))


@pytest.fixture(scope="module")
def look_up() -> ca.Function:
    theta, table = ca.MX.sym("theta"), PieceTable(BREAKS, TABLE)
    return ca.Function("look_up", [theta], [table(theta), table(theta, 1, 2)])


def test_values_on_every_piece_at_its_ends_and_beyond(look_up: ca.Function) -> None:
    inner = RNG.uniform(BREAKS[0], BREAKS[-1], 50)
    for theta in (*BREAKS, *inner, BREAKS[0] - 0.3, BREAKS[-1] + 0.3):
        piece = np.clip(np.searchsorted(BREAKS, theta, side="right") - 1, 0, 4)
        expected = TABLE[piece] @ (theta - BREAKS[piece]) ** np.arange(8)
        every, some = (np.array(values).ravel() for values in look_up(theta))
        np.testing.assert_allclose(every, expected, rtol=1e-13, atol=1e-14)
        np.testing.assert_array_equal(some, every[1:3])


@pytest.mark.parametrize("pieces", [1, 2])
def test_few_pieces(pieces: int) -> None:
    theta, table = ca.MX.sym("theta"), PieceTable(BREAKS[: pieces + 1], TABLE[:pieces])
    values = ca.Function("look_up", [theta], [table(theta)])
    last = BREAKS[pieces - 1]
    expected = TABLE[pieces - 1] @ (0.05 ** np.arange(8))
    np.testing.assert_allclose(np.array(values(last + 0.05)).ravel(), expected, rtol=1e-12)


def test_what_is_not_a_number_has_no_values(look_up: ca.Function) -> None:
    assert np.isnan(np.array(look_up(math.nan)[0])).all()
