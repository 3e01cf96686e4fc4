"""Compiled steps of force sensing against the same in numpy, branch by branch."""

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.control.compliance.force_sensing import guarded_compensation
from pfsc_drake.control.compliance.tool_load import SensorFault

RANGE = np.array([10.0, 20.0, 30.0, 1.0, 2.0, 3.0])
BIAS = np.array([0.5, -0.5, 0.0, 0.1, 0.0, -0.1])
STILL = 20  # samples
NOISELESS = np.zeros(6)


def compensation():
    """A stand-in with the same signature: r = measured - motion, next state 2 motion."""
    motion, state, known = ca.SX.sym("motion", 6), ca.SX.sym("state", 6), ca.SX.sym("known")
    measured, bias = ca.SX.sym("measured", 6), ca.SX.sym("bias", 6)
    residual = measured - motion
    return ca.Function(
        "stand_in",
        [motion, state, known, measured, bias],
        [residual - bias + known * state, residual, 2.0 * motion],
        ["motion", "state", "known", "measured", "bias"],
        ["wrench", "residual", "next_state"],
    )


@pytest.mark.parametrize("tared", [0.0, 1.0])
@pytest.mark.parametrize("latched", [SensorFault.NONE, SensorFault.LOST])
@pytest.mark.parametrize("case", ["good", "saturated", "negative", "lost motion", "lost sensor"])
def test_guard(tared, latched, case):
    function = BoundFunction(guarded_compensation(compensation(), RANGE, STILL, NOISELESS))
    x, rng = function.arguments, np.random.default_rng(3)
    for name in ("motion", "measured", "bias"):
        x[name][:] = rng.uniform(-0.9, 0.9, 6)
    x["state"][:6] = rng.uniform(-0.9, 0.9, 6)
    x["known"][:], x["tared"][:], x["fault"][:] = 1.0, tared, latched
    if case == "saturated":
        x["measured"][1] = RANGE[1]
    if case == "negative":
        x["measured"][4] = -RANGE[4]
    if case == "lost motion":
        x["motion"][2] = np.inf
    if case == "lost sensor":
        x["measured"][5] = np.nan
    function.evaluate()
    result = function.results["result"]
    residual = x["measured"] - x["motion"]
    wrench = residual - x["bias"] + x["state"][:6]
    after = np.concatenate([2.0 * x["motion"], x["measured"], np.zeros(6), np.ones(6)])
    fault = SensorFault.SATURATED if case in ("saturated", "negative") else SensorFault.NONE
    if latched or "lost" in case:
        wrench, residual, after = np.zeros(6), np.zeros(6), x["state"]
        fault = SensorFault.LOST
    if not tared:
        wrench = np.zeros(6)
    np.testing.assert_allclose(result[:6], wrench, rtol=0, atol=1e-15)
    assert (result[6], result[7]) == (tared, fault)
    np.testing.assert_allclose(result[8:14], residual, rtol=0, atol=1e-15)
    np.testing.assert_allclose(result[14:], after, rtol=0, atol=1e-15)


def watch(readings, noise=NOISELESS):
    """Return the fault at each reading of a sensor, shape (samples,)."""
    function = BoundFunction(guarded_compensation(compensation(), RANGE, STILL, noise))
    x, faults = function.arguments, []
    for reading in readings:
        x["measured"][:] = reading
        function.evaluate()
        result = function.results["result"]
        x["state"][:], faults = result[14:], [*faults, result[7]]
    return np.array(faults)


@pytest.mark.parametrize("component", range(6))
def test_a_component_that_stands_still_is_lost(component):
    readings = np.random.default_rng(component).normal(0.0, 0.1, (120, 6))
    assert not watch(readings).any()
    readings[60:, component] = readings[59, component]
    assert np.flatnonzero(watch(readings))[0] == 59 + STILL


def test_what_stands_still_without_being_broken_is_not_lost():
    rng = np.random.default_rng(1)
    noise = rng.normal(0.0, 0.1, (400, 6))
    # a component without noise is always the same
    without = noise.copy()
    without[:, 2] = 0.25
    assert not watch(without).any()
    # all rest at the same time
    resting = noise.copy()
    resting[200:] = resting[199]
    assert not watch(resting).any()
    # a sensor with steps as large as its noise, which first moved
    coarse = noise.copy()
    coarse[100:] = np.round(coarse[100:] / 0.1) * 0.1
    assert not watch(coarse).any()
    # the end of its range, which is said as such
    clipped = noise.copy()
    clipped[200:, 3] = RANGE[3]
    assert set(watch(clipped)[200:]) == {SensorFault.SATURATED}


def test_a_sensor_with_noise_that_stands_still_as_a_whole_is_lost():
    noise = np.repeat([0.1, 0.004], 3)
    readings = np.random.default_rng(3).normal(0.0, noise, (400, 6))
    assert not watch(readings, noise).any()
    # as it seems to rest without noise
    resting = readings.copy()
    resting[200:] = resting[199]
    assert np.flatnonzero(watch(resting, noise))[0] == 199 + STILL
    assert not watch(resting).any()
    # most of it, too few others being left to tell
    most = readings.copy()
    most[200:, :4] = most[199, :4]
    assert np.flatnonzero(watch(most, noise))[0] == 199 + STILL
    assert not watch(most).any()
    # from the start
    assert np.flatnonzero(watch(np.zeros((100, 6)), noise))[0] == STILL - 1
    # only half of it is known to have noise, and steps three times as large as noise hide some
    assert not watch(resting, np.where(np.arange(6) < 3, noise, 0.0)).any()
    assert not watch(np.round(readings / (3.0 * noise)) * 3.0 * noise, noise).any()
