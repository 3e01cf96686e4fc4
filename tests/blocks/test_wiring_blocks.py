"""Blocks that route vectors, with numbers."""

import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.blocks.wiring_blocks import Collect, Hold, Linear, Rows, Sum


@pytest.mark.parametrize("size", [1, 3])
@pytest.mark.parametrize("ticks", [1, 2, 5])
def test_hold_delays_by_its_ticks(size, ticks):
    values = np.random.default_rng(ticks).normal(size=(12, size))
    hold = Stepper(Hold(size, ticks))
    held = np.array([hold.step(value=value)["held"] for value in values])
    np.testing.assert_array_equal(held[ticks:], values[:-ticks])
    assert not held[:ticks].any()


def test_parts_are_where_their_rows_say():
    parts = {
        "one": np.array([1.0]),
        "three": np.array([2.0, 3.0, 4.0]),
        "two": np.array([5.0, 6.0]),
    }
    collect = Collect({name: len(part) for name, part in parts.items()})
    whole = Stepper(collect).step(**parts)["all"]
    assert len(whole) == 6
    for name, part in parts.items():
        np.testing.assert_array_equal(whole[collect.rows[name]], part)


def test_a_vector_is_picked_from_multiplied_and_added_to():
    x = np.array([1.0, -2.0, 4.0])
    np.testing.assert_array_equal(Stepper(Rows(3, [2, 0])).step(whole=x)["part"], [4.0, 1.0])
    matrix = np.array([[0.0, 2.0, 0.0], [1.0, 0.0, -1.0]])
    np.testing.assert_array_equal(Stepper(Linear(matrix)).step(vector=x)["product"], [-4.0, -3.0])
    added = Stepper(Sum(3, 3)).step(term_0=x, term_1=10.0 * x, term_2=[0.5, 0.0, 0.0])["sum"]
    np.testing.assert_array_equal(added, 11.0 * x + [0.5, 0.0, 0.0])
