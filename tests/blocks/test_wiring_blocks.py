"""What only leads vectors from one place to another, on numbers."""

import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.blocks.wiring_blocks import Hold


@pytest.mark.parametrize("size", [1, 3])
@pytest.mark.parametrize("ticks", [1, 2, 5])
def test_what_is_held_came_in_so_many_ticks_before(size, ticks):
    values = np.random.default_rng(ticks).normal(size=(12, size))
    hold = Stepper(Hold(size, ticks))
    held = np.array([hold.step(value=value)["held"] for value in values])
    np.testing.assert_array_equal(held[ticks:], values[:-ticks])
    assert not held[:ticks].any()
