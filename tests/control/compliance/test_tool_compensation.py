"""Tool compensation on numbers, a robot that rests or is placed, tick by tick without a plant."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.compliance.measured_wrench import Taring
from pfsc_drake.control.compliance.tool_compensation import (
    SensorFault,
    ToolCompensation,
    ToolCompensationParameters,
    compensation_function,
)
from pfsc_drake.control.estimation.filters import LowPass
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.systems.plants.reactions import tool_load_from_plant

PERIOD = 1e-3
STILL = 50  # samples
REST = np.array([0.2, 1.4, -0.5, 0.3, 1.0, -0.4])
RESTING = np.concatenate([REST, np.zeros(6), REST, np.zeros(6)])
RANGE = np.array([500.0, 400.0, 300.0, 20.0, 10.0, 30.0])
BIAS = np.array([0.5, -0.5, 0.0, 0.1, 0.0, -0.1])


@pytest.fixture(name="arm", scope="module")
def fixture_arm():
    """Return the robot, and what hangs below its sensor."""
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(resolve_model("comau_racer_1_4")))
    plant.Finalize()
    tool = plant.GetFrameByName("tool_point")
    chain, _ = chain_from_plant(plant, tool)
    return chain, tool_load_from_plant(plant, plant.GetJointByName("weld_tool"), tool)


def stepper(arm, **parameters):
    parameters = ToolCompensationParameters(**({"taring_time": 0.01} | parameters))
    return Stepper(ToolCompensation(*arm, RANGE, parameters, PERIOD))


def watch(block, readings, states=RESTING):
    """Return what a block makes of readings, each (samples, size)."""
    states = np.broadcast_to(states, (len(readings), 24))
    rows = [
        block.step(measured_wrench=reading, joint_state=state)
        for reading, state in zip(readings, states, strict=True)
    ]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


@pytest.mark.parametrize("inertia", ["differentiated", "given"])
@pytest.mark.parametrize("tared", [0.0, 1.0])
@pytest.mark.parametrize("latched", [SensorFault.NONE, SensorFault.LOST])
@pytest.mark.parametrize("case", ["good", "saturated", "negative", "lost motion", "lost sensor"])
def test_guard(arm, inertia, tared, latched, case):
    """Branch by branch: a compensation that gives nothing before taring and after a fault."""
    block, rng = stepper(arm, inertia=inertia), np.random.default_rng(3)
    u = {"measured_wrench": rng.uniform(-9, 9, 6), "joint_state": rng.uniform(-1, 1, 24)}
    if inertia == "given":
        u["joint_acceleration"] = rng.uniform(-1, 1, 6)
    block.start(**u)
    before = {
        "bias": BIAS,
        "tared": tared,
        "fault": latched,
        "known": 1.0,
        "filter": rng.uniform(-1, 1, 18),
    }
    for name, value in before.items():
        block.set_state(name, value)
    if case == "saturated":
        u["measured_wrench"][1] = RANGE[1]
    if case == "negative":
        u["measured_wrench"][4] = -RANGE[4]
    if case == "lost motion":
        u["joint_state"][2] = np.inf
    if case == "lost sensor":
        u["measured_wrench"][5] = np.nan
    result, after = block.step(**u), block.states
    motion = np.concatenate([u["joint_state"][:12], u.get("joint_acceleration", [])])
    alone = compensation_function(*arm, LowPass(200.0, PERIOD), inertia)
    wrench, residual, filtered = (
        np.array(value).ravel()
        for value in alone(motion, before["filter"], 1.0, u["measured_wrench"], BIAS)
    )
    watched = np.concatenate([u["measured_wrench"], np.zeros(6), np.ones(6)])
    fault = SensorFault.SATURATED if case in ("saturated", "negative") else SensorFault.NONE
    if latched or "lost" in case:
        wrench, residual = np.zeros(6), np.zeros(6)
        filtered, watched, fault = before["filter"], np.zeros(18), SensorFault.LOST
    if not tared:
        wrench = np.zeros(6)
    np.testing.assert_allclose(result["wrench"], wrench, rtol=0, atol=1e-12)
    assert (result["tared"], result["fault"]) == (tared, fault)
    np.testing.assert_allclose(result["residual"], residual, rtol=0, atol=1e-12)
    np.testing.assert_allclose(after["filter"], filtered, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(after["watched"], watched)
    assert after["fault"] == (SensorFault.LOST if fault == SensorFault.LOST else SensorFault.NONE)
    # taring goes on where it has not ended, with what is within the range
    assert after["taring_count"] == (fault == SensorFault.NONE and not tared)


def test_it_is_tared_by_the_mean_that_counts(arm):
    """The first of two blocks of 10 ms does not; the reading of the next tick is the residual."""
    readings = np.random.default_rng(2).normal(BIAS, 0.05, (30, 6))
    block = stepper(arm, taring_time=0.02)
    found = watch(block, readings)
    assert np.array_equal(found["tared"].ravel(), np.arange(30) >= 20)
    bias = found["residual"][10:20].mean(axis=0)
    np.testing.assert_allclose(block.states["bias"], bias, rtol=0, atol=1e-12)
    assert not found["wrench"][:20].any()
    left = np.linalg.norm(found["residual"][20:, :3] - bias[:3], axis=1)
    np.testing.assert_allclose(np.linalg.norm(found["wrench"][20:, :3], axis=1), left, atol=1e-12)
    assert not any(block.states[name].any() for name in Taring.states)


def test_the_first_motion_is_where_the_filter_rests(arm):
    """Also if it comes after readings that are none; a robot that is placed has no inertia."""
    block, readings = stepper(arm), np.tile([0, 0, -14.0, 0, 0, 0], (3, 1))
    first = watch(block, readings)["residual"]
    np.testing.assert_allclose(first, np.broadcast_to(first[0], (3, 6)), rtol=0, atol=1e-12)


def test_a_sensor_that_fails_gives_zero_and_a_fault_until_it_is_tared_again(arm):
    readings = np.zeros((51, 6))
    readings[:, 2] = np.where(np.arange(51) > 20, 9.0, -14.0)
    readings[30, 5] = np.nan
    block = stepper(arm)
    found = watch(block, readings)
    assert np.linalg.norm(found["wrench"][25, :3]) == pytest.approx(23.0)
    assert np.all(found["fault"][30:] == SensorFault.LOST)
    assert not found["wrench"][30:].any() and not found["residual"][30:].any()
    assert all(np.isfinite(value).all() for value in found.values())
    assert found["fault"][29] == SensorFault.NONE
    for name in ("tared", "fault", "known", "watched"):
        block.set_state(name, 0.0)
    found = watch(block, readings[:30])
    assert not any(found[name][:10].any() for name in ("wrench", "tared", "fault"))
    assert found["tared"][-1] == 1.0 and found["fault"][-1] == SensorFault.NONE
    assert np.linalg.norm(found["wrench"][15]) < 1e-9


def test_a_joint_state_that_is_not_finite_is_a_fault_too(arm):
    states = np.tile(RESTING, (31, 1))
    states[21:, 2] = np.nan
    found = watch(stepper(arm), np.zeros((31, 6)), states)
    assert np.array_equal(found["fault"].ravel() == SensorFault.LOST, np.arange(31) >= 21)
    assert not found["wrench"][21:].any()


def test_saturation_while_working_is_reported_as_long_as_it_lasts(arm):
    readings, now = np.zeros((41, 6)), np.isin(np.arange(41), range(20, 25))
    readings[now, 0] = 510.0
    found = watch(stepper(arm), readings)
    assert np.array_equal(found["fault"].ravel() == SensorFault.SATURATED, now)
    assert np.linalg.norm(found["wrench"][22, :3]) == pytest.approx(510.0)


def test_saturation_while_taring_begins_it_anew(arm):
    readings = np.zeros((41, 6))
    readings[7, 0] = RANGE[0]
    found = watch(stepper(arm), readings)
    assert np.array_equal(found["tared"].ravel(), np.arange(41) >= 18)


def test_dead_bands_swallow_what_is_small(arm):
    readings, k = np.zeros((41, 6)), np.arange(41)
    readings[:, 0] = 3.0 * (1.0 + 3.0 * (k > 30)) * (k > 20)
    found = watch(stepper(arm, force_dead_band=4.0, torque_dead_band=0.5), readings)
    assert not found["wrench"][:31].any()
    assert np.linalg.norm(found["wrench"][35, :3]) == pytest.approx(8.0)
    # 12 N at a lever of 0.12 m
    assert np.linalg.norm(found["wrench"][35, 3:]) == pytest.approx(0.94)


def faults(arm, readings, noise=0.0):
    """Return the fault at each reading of a sensor at rest, shape (samples,)."""
    return watch(stepper(arm, noise=np.broadcast_to(noise, 6)), readings)["fault"].ravel()


@pytest.mark.parametrize("component", range(6))
def test_a_component_that_stands_still_is_lost(arm, component):
    readings = np.random.default_rng(component).normal(0.0, 0.1, (160, 6))
    assert not faults(arm, readings).any()
    readings[80:, component] = readings[79, component]
    assert np.flatnonzero(faults(arm, readings))[0] == 79 + STILL


def test_what_stands_still_without_being_broken_is_not_lost(arm):
    rng = np.random.default_rng(1)
    noise = rng.normal(0.0, 0.1, (400, 6))
    # a component without noise is always the same
    without = noise.copy()
    without[:, 2] = 0.25
    assert not faults(arm, without).any()
    # all rest at the same time
    resting = noise.copy()
    resting[200:] = resting[199]
    assert not faults(arm, resting).any()
    # a sensor with steps as large as its noise, which first moved
    coarse = noise.copy()
    coarse[100:] = np.round(coarse[100:] / 0.1) * 0.1
    assert not faults(arm, coarse).any()
    # the end of its range, which is said as such
    clipped = noise.copy()
    clipped[200:, 3] = RANGE[3]
    assert set(faults(arm, clipped)[200:]) == {SensorFault.SATURATED}


def test_a_sensor_with_noise_that_stands_still_as_a_whole_is_lost(arm):
    noise = np.repeat([0.1, 0.004], 3)
    readings = np.random.default_rng(3).normal(0.0, noise, (400, 6))
    assert not faults(arm, readings, noise).any()
    # as it seems to rest without noise
    resting = readings.copy()
    resting[200:] = resting[199]
    assert np.flatnonzero(faults(arm, resting, noise))[0] == 199 + STILL
    assert not faults(arm, resting).any()
    # most of it, too few others being left to tell
    most = readings.copy()
    most[200:, :4] = most[199, :4]
    assert np.flatnonzero(faults(arm, most, noise))[0] == 199 + STILL
    assert not faults(arm, most).any()
    # from the start
    assert np.flatnonzero(faults(arm, np.zeros((100, 6)), noise))[0] == STILL - 1
    # only half of it is known to have noise, and steps three times as large as noise hide some
    assert not faults(arm, resting, np.where(np.arange(6) < 3, noise, 0.0)).any()
    assert not faults(arm, np.round(readings / (3.0 * noise)) * 3.0 * noise, noise).any()


def test_a_sensor_without_noise_that_stands_still_while_the_robot_moves_is_lost(arm):
    """At rest it may: nothing else changes either."""
    readings = np.random.default_rng(5).normal(0.0, 0.1, (200, 6))
    readings[120:] = readings[119]
    states = np.tile(RESTING, (200, 1))
    assert not watch(stepper(arm), readings, states)["fault"].any()
    states[:, 8] = 0.02  # of the joint that turns the hand
    found = watch(stepper(arm), readings, states)["fault"].ravel()
    assert np.flatnonzero(found)[0] == 119 + STILL
    assert set(found[119 + STILL :]) == {SensorFault.LOST}
    states[:, 8] = 0.005
    assert not watch(stepper(arm), readings, states)["fault"].any()


@pytest.mark.parametrize(
    ("component", "size", "judged"),
    [(0, 27.0, True), (1, -27.0, True), (2, 23.0, False), (3, 1.1, True), (5, -0.9, False)],
)
def test_a_reading_that_jumps_is_a_fault_once_it_is_tared(arm, component, size, judged):
    readings = np.random.default_rng(component).normal(BIAS, [0.05] * 3 + [0.002] * 3, (60, 6))
    readings[40:, component] += size
    noise = np.repeat([0.05, 0.002], 3)
    found = watch(stepper(arm, noise=noise), readings)
    expected = np.where(judged & (np.arange(60) >= 42), SensorFault.JUMPED, SensorFault.NONE)
    np.testing.assert_array_equal(found["fault"].ravel(), expected)
    assert found["wrench"][50].any() != judged
    assert not watch(stepper(arm, noise=noise, jump=np.full(6, np.inf)), readings)["fault"].any()
    # while it is being tared, that begins anew
    assert not watch(stepper(arm, noise=noise, taring_time=0.05), readings)["fault"].any()


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("inertia", "full"),
        ("bandwidth", 0.0),
        ("taring_time", -1.0),
        ("force_dead_band", -1.0),
        ("torque_dead_band", np.inf),
        ("taring_spread", np.ones(3)),
        ("taring_bias", np.zeros(6)),
        ("jump", np.zeros(6)),
        ("noise", np.full(6, -0.1)),
        ("noise", np.array([0.1, 0.1, 0.1, 0.0, 0.0, np.inf])),
    ],
)
def test_parameters_out_of_range(key, value):
    with pytest.raises(InputError, match=f"^{key} = .*; allowed: "):
        ToolCompensationParameters(**{key: value})


def test_accelerations_in_steps_are_the_filtered_differences_of_velocities(arm):
    """As if the held acceleration itself were given, through the same low-pass."""
    rng, low_pass = np.random.default_rng(4), LowPass(200.0, PERIOD)
    differentiated, explicit = (
        compensation_function(*arm, low_pass, inertia) for inertia in ("differentiated", "given")
    )
    states = [np.zeros(differentiated.nnz_in(1)), np.zeros(explicit.nnz_in(1))]
    q, v, known, largest = REST.copy(), np.zeros(6), 0.0, 0.0
    for k in range(40):
        a = rng.uniform(-8.0, 8.0, 6) if k else np.zeros(6)
        q, v = q + PERIOD * v, v + PERIOD * a
        motions, residuals = (np.concatenate([q, v]), np.concatenate([q, v, a])), []
        for i, function in enumerate((differentiated, explicit)):
            _, residual, states[i] = function(motions[i], states[i], known, np.zeros(6), 0.0)
            residuals.append(np.array(residual).ravel())
        np.testing.assert_allclose(*residuals, rtol=0, atol=1e-9)
        largest, known = max(largest, np.ptp(residuals[0][:3])), 1.0
    assert largest > 1.0
