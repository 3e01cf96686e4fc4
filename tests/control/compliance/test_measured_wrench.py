"""A measured wrench: its bias, components that stand still, when it is lost, a payload on it."""

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.blocks.block import Values
from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.compliance.measured_wrench import MeasuredWrench, SensorFault, Taring

SPREAD, LARGEST = np.full(6, 1.0), np.full(6, 10.0)


def empty():
    return Values(**{name: ca.DM.zeros(size) for name, size in Taring.states.items()})


def search(taring, residuals):
    """Return how many residuals it takes, and the bias; None if it is not found in them."""
    stretch = empty()
    for k, residual in enumerate(residuals):
        stretch = taring.extend(stretch, ca.DM(np.broadcast_to(residual, 6)))
        bias, is_long, is_plausible = taring.bias(stretch)
        if is_long:
            assert is_plausible
            return k + 1, np.array(bias).ravel()
    return None


def test_it_takes_the_mean_of_a_quiet_stretch_after_a_restless_one():
    taring = Taring(4, SPREAD, LARGEST)
    count, bias = search(taring, [0.0, 0.5, 3.7, 2.0, 2.2, 2.4, 2.6, 2.8])
    assert (count, bias) == (7, pytest.approx(np.full(6, 2.3)))


def test_what_fades_in_the_first_block_is_no_bias():
    """A transient that one block's mean hardly shows."""
    taring = Taring(20, SPREAD, LARGEST, block=10)
    count, bias = search(taring, 2.0 + 5.0 * 0.3 ** np.arange(25))
    assert (count, bias) == (20, pytest.approx(np.full(6, 2.0), abs=1e-4))


def test_strokes_of_a_sample_do_not_keep_a_sensor_from_being_tared():
    """A permanent change prevents it, though successive samples differ by less."""
    taring = Taring(48, SPREAD, LARGEST, block=10)
    strokes = 2.0 + np.resize([4.0, -4.0, 0.0, 0.0, 0.0], 50)
    assert search(taring, strokes) == (50, pytest.approx(np.full(6, 2.0)))
    assert search(taring, strokes[:49]) is None  # blocks are whole
    assert search(taring, strokes + 0.05 * np.arange(50)) is None


@pytest.mark.parametrize(("value", "plausible"), [(10.0, True), (10.1, False), (-10.1, False)])
def test_a_bias_that_is_too_large_is_implausible(value, plausible):
    taring = Taring(1, SPREAD, LARGEST)
    stretch = taring.extend(empty(), ca.DM([0, 0, value, 0, 0, 0]))
    _, is_long, is_plausible = taring.bias(stretch)
    assert (bool(is_long), bool(is_plausible)) == (True, plausible)


def by_definition(residuals, samples, block):
    """Return the result for all residuals: they are cut into blocks and evaluated from the end."""
    block = min(block, samples)
    needed = -(-samples // block)
    blocks = [residuals[k : k + block] for k in range(0, len(residuals) - block + 1, block)]
    means = np.array([b.mean(axis=0) for b in blocks])
    first = 0
    for last in range(len(blocks)):
        stretch = means[first : last + 1]
        if np.any(np.ptp(stretch, axis=0) > SPREAD):
            first = last
        if last + 1 - first == needed:
            skipped = first + (block > 1 and needed > 1)
            return (last + 1) * block, np.concatenate(blocks[skipped : last + 1]).mean(axis=0)
    return None


@pytest.mark.parametrize(("samples", "block"), [(1, 1), (7, 1), (30, 10), (25, 10), (8, 10)])
def test_it_is_what_its_definition_says(samples, block):
    """Residuals that jump now and then, in one component or the other."""
    rng, found = np.random.default_rng(samples + block), 0
    for _ in range(8):
        residuals = rng.normal(0.0, 0.2, (120, 6))
        for k in rng.integers(0, 120, 4):
            residuals[k:, rng.integers(6)] += 1.5
        expected, got = (
            by_definition(residuals, samples, block),
            search(Taring(samples, SPREAD, LARGEST, block), residuals),
        )
        assert (expected is None) == (got is None)
        if expected is not None:
            found += 1
            assert expected[0] == got[0]
            np.testing.assert_allclose(got[1], expected[1], rtol=0, atol=1e-14)
    assert found


@pytest.mark.parametrize("spoiled", [None, np.nan, np.inf, -np.inf])
def test_what_is_no_finite_number_is_a_lost_sensor(spoiled):
    wrench = np.arange(6.0)
    wrench[4] = wrench[4] if spoiled is None else spoiled
    outputs = Stepper(MeasuredWrench()).step(wrench=wrench)
    np.testing.assert_array_equal(outputs["measured"], wrench)
    assert outputs["sensor_fault"][0] == (SensorFault.NONE if spoiled is None else SensorFault.LOST)
    assert outputs["tared"][0] == 1.0
