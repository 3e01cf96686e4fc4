"""Modes against known poles; which variables are in a loop against a graph drawn by hand."""

import numpy as np
from scipy.linalg import expm

from pfsc_drake.control.margins import in_loop, modes

T = 1e-3


def test_rates_and_damping_are_those_of_the_continuous_system():
    omega, zeta, rate = 60.0, 0.25, -9.0
    oscillator = np.array([[0.0, 1.0], [-(omega**2), -2.0 * zeta * omega]])
    continuous = np.block([[oscillator, np.zeros((2, 1))], [np.zeros((1, 2)), rate]])
    found = modes(expm(continuous * T), T)
    np.testing.assert_allclose(found.rate, [rate, -zeta * omega, -zeta * omega], rtol=1e-9)
    damped = omega * np.sqrt(1.0 - zeta**2)
    np.testing.assert_allclose(found.frequency, [0.0, damped, damped], rtol=1e-9)
    np.testing.assert_allclose(found.damping, [1.0, zeta, zeta], rtol=1e-9)
    assert found.slowest == found.rate[0]
    assert found.is_stable


def test_what_grows_comes_first_and_has_no_damping():
    found = modes(np.diag([0.5, 1.01]), T)
    assert not found.is_stable
    np.testing.assert_allclose(found.slowest, np.log(1.01) / T)
    np.testing.assert_allclose(found.smallest_damping, -1.0)


def test_neutral_modes_are_counted_apart():
    found = modes(np.diag([1.0, 0.9, 1.0]), T)
    assert found.neutral == 2
    assert len(found.rate) == 1
    assert found.is_stable


def test_a_deadbeat_mode_is_fast_and_finite():
    found = modes(np.array([[0.0, 1.0], [0.0, 0.0]]), T)
    assert found.slowest < -1e4
    assert np.all(np.isfinite(found.rate))


def test_only_what_comes_back_is_in_the_loop():
    # plant 0, 1; controller 2; disturbance 3 -> 1; integral without gain 2 -> 4; counter 5;
    # 6 -> 7 -> plant, and plant -> 6: at two removes
    arrows = [(0, 1), (1, 0), (1, 2), (2, 0), (3, 1), (3, 3), (2, 4), (4, 4), (5, 5)]
    arrows += [(0, 6), (6, 7), (7, 1)]
    changes = np.zeros((8, 8), dtype=bool)
    for source, target in arrows:
        changes[target, source] = True
    core = np.arange(8) < 2
    np.testing.assert_array_equal(np.flatnonzero(in_loop(changes, core)), [0, 1, 2, 6, 7])
