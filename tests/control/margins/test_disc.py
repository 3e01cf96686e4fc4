"""Disc margins against closed forms, Nyquist curves, and loops driven over the edge."""

import numpy as np
import pytest
from scipy.signal import place_poles

from pfsc_drake.control.margins import NO_MARGIN, BrokenLoop, common_disc_margin, disc_margins

T = 1e-3


def first_order(gain, a=1.0):
    """``x+ = a x + b u``, ``u = -gain x`` held: variables right after a tick, x and u."""
    b = 1.0
    return np.array([[a, b], [-gain * a, -gain * b]])


def two_drives(rng):
    """A plant of four states with two drives, and a stable state feedback after each tick."""
    A = 0.95 * np.eye(4) + 0.05 * rng.standard_normal((4, 4))
    B = 0.2 * rng.standard_normal((4, 2))
    K = place_poles(A, B, [0.9, 0.85, 0.93, 0.97]).gain_matrix
    return A, B, K, np.block([[A, B], [-K @ A, -K @ B]])


def test_an_integrator_bears_what_its_nyquist_curve_says():
    gain = 0.4
    # T(z) = gain / (z - 1 + gain), |S - T| largest at z = -1: (2 + gain) / (2 - gain)
    margin = disc_margins(BrokenLoop(first_order(gain), np.array([1]), T))[0]
    np.testing.assert_allclose(margin.alpha, 2.0 * (2.0 - gain) / (2.0 + gain), rtol=1e-9)
    np.testing.assert_allclose(margin.frequency, np.pi / T)
    # the loop is stable for gains below 2
    np.testing.assert_allclose(margin.gain[1], 2.0 / gain, rtol=1e-9)


def test_phase_margin_is_that_of_the_disc():
    margin = disc_margins(BrokenLoop(first_order(0.4), np.array([1]), T))[0]
    low, high = margin.gain
    np.testing.assert_allclose(low * high, 1.0)
    # the disc's edge leaves the unit circle at this angle
    centre, radius = (low + high) / 2.0, (high - low) / 2.0
    edge = np.exp(1j * margin.phase)
    np.testing.assert_allclose(abs(edge - centre), radius, rtol=1e-9)


def test_a_loop_without_feedback_bears_any_gain():
    margin = disc_margins(BrokenLoop(first_order(0.0, a=0.5), np.array([1]), T))[0]
    np.testing.assert_allclose(margin.alpha, 2.0)
    assert margin.gain == (0.0, np.inf)


@pytest.mark.slow(but=["1", "2"])
@pytest.mark.parametrize("seed", range(4))
def test_the_margin_is_the_smallest_disc_that_makes_the_loop_unstable(seed):
    A, B, K, closed = two_drives(np.random.default_rng(seed))
    assert np.max(np.abs(np.linalg.eigvals(closed))) < 1.0
    for drive, margin in enumerate(disc_margins(BrokenLoop(closed, np.array([4, 5]), T))):
        # the disc of factors f = (1 + d/2) / (1 - d/2), |d| <= alpha
        angles = np.linspace(0.0, 2.0 * np.pi, 721)
        worst = {}
        for scale in (0.999, 1.02):
            d = scale * margin.alpha * np.exp(1j * angles)
            largest = 0.0
            for factor in (1.0 + d / 2.0) / (1.0 - d / 2.0):
                F = np.eye(2, dtype=complex)
                F[drive, drive] = factor
                largest = max(largest, np.max(np.abs(np.linalg.eigvals(A - B @ F @ K))))
            worst[scale] = largest
        assert worst[0.999] < 1.0
        assert worst[1.02] > 1.0


@pytest.mark.slow(but=["0", "3"])
@pytest.mark.parametrize("seed", range(4))
def test_all_drives_at_once_bear_the_common_margin(seed):
    rng = np.random.default_rng(seed)
    A, B, K, closed = two_drives(rng)
    holds = np.array([4, 5])
    assert np.max(np.abs(np.linalg.eigvals(closed))) < 1.0
    common = common_disc_margin(BrokenLoop(closed, holds, T))
    assert common.alpha <= min(m.alpha for m in disc_margins(BrokenLoop(closed, holds, T))) * (
        1.0 + 1e-6
    )
    for _ in range(2000):
        d = 0.999 * common.alpha * np.exp(2j * np.pi * rng.random(2))
        F = np.diag((1.0 + d / 2.0) / (1.0 - d / 2.0))
        assert np.max(np.abs(np.linalg.eigvals(A - B @ F @ K))) < 1.0


def test_units_of_the_drives_do_not_matter_to_the_common_margin():
    _, _, _, closed = two_drives(np.random.default_rng(7))
    holds, scale = np.array([4, 5]), np.array([1.0, 1.0, 1.0, 1.0, 1e3, 1e-2])
    scaled = scale[:, None] * closed / scale
    np.testing.assert_allclose(
        common_disc_margin(BrokenLoop(scaled, holds, T)).alpha,
        common_disc_margin(BrokenLoop(closed, holds, T)).alpha,
        rtol=1e-3,
    )


def test_an_unstable_loop_has_no_margin():
    unstable = first_order(-0.4)
    assert disc_margins(BrokenLoop(unstable, np.array([1]), T)) == [NO_MARGIN]
    assert common_disc_margin(BrokenLoop(unstable, np.array([1]), T)) == NO_MARGIN


def test_a_resonance_between_two_frequencies_of_the_grid_is_seen():
    """A mode with a damping ratio of 1e-7 is far narrower than the grid's steps."""
    angle, damping, gain = 0.31415, 1e-7, -2e-8
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    A, B, K = np.exp(-damping * angle) * turn, np.array([[0.0], [1.0]]), np.array([[0.0, gain]])
    loop = BrokenLoop(np.block([[A, B], [-K @ A, -K @ B]]), np.array([2]), T)
    margin = disc_margins(loop)[0]
    near = angle / T * (1.0 + np.linspace(-30.0 * damping, 30.0 * damping, 4001))
    narrow = 2.0 / np.abs(loop(near)[:, 0, 0]).max()
    apart = loop.frequencies[np.abs(loop.frequencies - angle / T) > 1e-3]
    # the resonance is what limits, and no other frequency tells
    assert narrow < 0.9 * 2.0 / np.abs(loop(apart)[:, 0, 0]).max()
    assert margin.alpha == pytest.approx(narrow, rel=2e-2)
