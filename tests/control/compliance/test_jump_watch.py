"""Steps of a load that its amplifier would not let through, and those that it would."""

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.control.compliance.jump_watch import JumpWatch

BANDWIDTH, PERIOD = 200.0, 1e-3
SMALLEST = np.repeat([25.0, 1.0], 3)
NOISE = np.repeat([0.1, 0.004], 3)


def jumps(loads, at_range=False, bandwidth=BANDWIDTH, noise=NOISE):
    """Return the samples at which a jump is found in loads of component 1, shape (samples,)."""
    watch, memory = JumpWatch(SMALLEST, noise, bandwidth, PERIOD), ca.DM.zeros(JumpWatch.size)
    found = []
    for k, load in enumerate(loads):
        jumped, memory = watch.step(ca.DM([0, load, 0, 0, 0, 0]), memory, ca.DM([0, at_range] * 3))
        found += [k] if jumped else []
    return found


def filtered(force, samples=12, steps=40):
    """Return samples of a force ``force(t)`` behind a first-order filter, integrated finely."""
    step, value, readings = PERIOD / steps, 0.0, []
    share = 1.0 - np.exp(-2.0 * np.pi * BANDWIDTH * step)
    for k in range(samples * steps):
        value += share * (force((k + 0.5) * step) - value)
        readings += [value] if (k + 1) % steps == 0 else []
    return np.array(readings)


@pytest.mark.parametrize("size", [26.0, -100.0])
def test_a_step_behind_the_amplifier_is_found_two_samples_later(size):
    loads = np.where(np.arange(12) >= 5, size, 0.0) + np.resize([0.2, -0.2, 0.1], 12)
    assert jumps(loads) == [7]
    assert jumps(loads * 0.9) == ([7] if abs(size) > 30.0 else [])
    assert not jumps(loads, at_range=True)


@pytest.mark.parametrize("phase", [0.0, 0.3, 0.7, 0.95])
@pytest.mark.parametrize("decay", [5e-4, 1e-3, 2e-3, 3e-3, 4e-3, 6e-3, 1e-2, 1.0])
def test_force_steps_and_impacts_are_no_faults(phase, decay):
    """Steps of 400 N at any instant within a sample, decaying within 0.5 ms or constant."""
    begin = (3.0 + phase) * PERIOD
    loads = filtered(lambda t: 400.0 * np.exp(-(t - begin) / decay) * (t >= begin))
    assert np.abs(np.diff(loads)).max() > SMALLEST[1]
    assert not jumps(loads)


def test_noise_alone_is_none():
    loads = np.random.default_rng(4).normal(0.0, 10.0, 2000)
    assert not jumps(loads, noise=np.full(6, 10.0))
    stepping = loads[:12] + np.where(np.arange(12) >= 5, 600.0, 0.0)
    assert jumps(stepping, noise=np.full(6, 10.0)) == [7]


@pytest.mark.parametrize(("bandwidth", "judges"), [(440.0, True), (460.0, False)])
def test_an_amplifier_that_lets_steps_through_proves_nothing(bandwidth, judges):
    loads = np.where(np.arange(12) >= 5, 100.0, 0.0)
    assert bool(jumps(loads, bandwidth=bandwidth)) == judges
