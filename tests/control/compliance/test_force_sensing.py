"""Compiled steps of force sensing against the same in numpy, branch by branch."""

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.control.compliance.force_sensing import guarded_compensation
from pfsc_drake.control.compliance.tool_load import SensorFault
from pfsc_drake.control.estimation.low_pass import LowPass
from pfsc_drake.physics.transducer import transducer_function

RANGE = np.array([10.0, 20.0, 30.0, 1.0, 2.0, 3.0])
BIAS = np.array([0.5, -0.5, 0.0, 0.1, 0.0, -0.1])


@pytest.fixture(name="transducer")
def fixture_transducer():
    low_pass = LowPass(150.0, 1e-3)
    bound = BoundFunction(transducer_function(low_pass, BIAS, RANGE))

    def step(load, state, noise=0.0):
        # the tool pulls back, and Drake writes the torque first
        bound.arguments["reaction"][:] = np.roll(np.multiply(load, -1.0), 3)
        bound.arguments["state"][:], bound.arguments["noise"][:] = state, noise
        bound.evaluate()
        np.testing.assert_array_equal(bound.results["load"], load)
        return bound.results["reading"].copy(), bound.results["next_state"].copy()

    return low_pass, step


def test_filter_bias_and_noise(transducer):
    low_pass, step = transducer
    rng = np.random.default_rng(0)
    state = expected = low_pass.rest(rng.uniform(-0.3, 0.3, 6))
    for _ in range(5):
        load, noise = rng.uniform(-0.5, 0.5, (2, 6))
        reading, state = step(load, state, noise)
        filtered, expected = low_pass.output(expected, load), low_pass.update(expected, load)
        np.testing.assert_allclose(reading, filtered + BIAS + noise, rtol=0, atol=1e-15)
        np.testing.assert_allclose(state, expected, rtol=0, atol=1e-15)


def test_it_starts_at_rest_component_by_component(transducer):
    low_pass, step = transducer
    load = np.arange(6.0) / 10.0
    state = np.where(np.arange(6) < 3, np.nan, 0.0)
    reading, after = step(load, state)
    np.testing.assert_allclose(reading[:3], (load + BIAS)[:3], rtol=0, atol=1e-15)
    np.testing.assert_allclose(after[:3], low_pass.rest(load)[:3], rtol=0, atol=1e-15)
    np.testing.assert_allclose(after[3:], low_pass.update(np.zeros(3), load[3:]), atol=1e-15)


def test_range_and_nan(transducer):
    low_pass, step = transducer
    for sign in (1.0, -1.0):
        reading, _ = step(sign * 2.0 * RANGE, low_pass.rest(sign * 2.0 * RANGE))
        np.testing.assert_array_equal(reading, sign * RANGE)
    lost = np.where(np.arange(6) == 2, np.nan, 0.1)
    reading, after = step(lost, np.zeros(6))
    assert np.array_equal(np.isnan(reading), np.isnan(lost))
    # and it goes on from the next load that is a number
    reading, after = step(np.full(6, 0.2), after)
    assert reading[2] == pytest.approx(0.2 + BIAS[2], abs=1e-15)
    assert np.isfinite(after).all()


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
@pytest.mark.parametrize("latched", [SensorFault.NONE, SensorFault.NOT_FINITE])
@pytest.mark.parametrize("case", ["good", "saturated", "negative", "lost motion", "lost sensor"])
def test_guard(tared, latched, case):
    function = BoundFunction(guarded_compensation(compensation(), RANGE))
    x, rng = function.arguments, np.random.default_rng(3)
    for name in ("motion", "measured", "bias", "state"):
        x[name][:] = rng.uniform(-0.9, 0.9, 6)
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
    wrench, after = residual - x["bias"] + x["state"], 2.0 * x["motion"]
    fault = SensorFault.SATURATED if case in ("saturated", "negative") else SensorFault.NONE
    if latched or "lost" in case:
        wrench, residual, after = np.zeros(6), np.zeros(6), x["state"]
        fault = SensorFault.NOT_FINITE
    if not tared:
        wrench = np.zeros(6)
    np.testing.assert_allclose(result[:6], wrench, rtol=0, atol=1e-15)
    assert (result[6], result[7]) == (tared, fault)
    np.testing.assert_allclose(result[8:14], residual, rtol=0, atol=1e-15)
    np.testing.assert_allclose(result[14:], after, rtol=0, atol=1e-15)
