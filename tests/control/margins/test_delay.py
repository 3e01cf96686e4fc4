"""Delay margins against a loop that is simulated with the delay."""

import numpy as np
import pytest

from pfsc_drake.control.margins import MOST, delay_margin, with_delay

T = 1e-3


def simulated(a, b, gain, intervals, steps=400):
    """``x+ = a x + b u``, ``u = -gain x`` commanded now and acting some intervals later."""
    x, told = np.array([1.0, -0.5]), [np.zeros(1)] * intervals
    history = []
    for _ in range(steps):
        told.append(-gain @ x)
        x = a @ x + b @ told.pop(0)
        history.append(np.linalg.norm(x))
    return np.array(history)


def double_integrator():
    a, b = np.array([[1.0, T], [0.0, 1.0]]), np.array([[T**2 / 2.0], [T]])
    gain = np.array([[60.0**2, 2.0 * 60.0]])
    return a, b, gain, np.block([[a, b], [-gain @ a, -gain @ b]])


def test_without_delay_nothing_changes():
    closed = double_integrator()[3]
    np.testing.assert_array_equal(with_delay(closed, np.array([2]), 0), closed)


@pytest.mark.parametrize("intervals", [1, 2, 3])
def test_the_delayed_map_moves_like_the_delayed_loop(intervals):
    a, b, gain, closed = double_integrator()
    A = with_delay(closed, np.array([2]), intervals)
    x = np.zeros(len(A))
    x[:2] = [1.0, -0.5]
    x[2] = (-gain @ x[:2])[0]
    own = []
    for _ in range(50):
        x = A @ x
        own.append(np.linalg.norm(x[:2]))
    np.testing.assert_allclose(own, simulated(a, b, gain, intervals, 50), rtol=1e-9)


def test_the_margin_is_the_longest_delay_that_still_converges():
    a, b, gain, closed = double_integrator()
    margin = delay_margin(closed, np.array([2]), T)
    borne, too_long = (simulated(a, b, gain, margin + more, 4000) for more in (0, 1))
    assert 0 < margin < MOST
    assert borne[-1] < 1e-2 * borne[0]
    assert too_long[-1] > 10.0 * too_long[0]


def test_an_unstable_loop_bears_less_than_no_delay():
    assert delay_margin(np.diag([1.1, 0.0]), np.array([1]), T) == -1


def test_a_loop_that_needs_no_drive_bears_any_delay():
    assert delay_margin(np.diag([0.9, 0.0]), np.array([1]), T) == MOST
