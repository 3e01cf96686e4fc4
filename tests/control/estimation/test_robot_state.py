"""Estimated robot state: links behind elastic joints, and prediction over a delay."""

import numpy as np
import pytest
import scipy.linalg
from scipy.integrate import solve_ivp

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.estimation.momentum import MomentumObserver, motor_momentum
from pfsc_drake.control.estimation.robot_state import LinkState, StatePredictor
from pfsc_drake.errors import InputError
from pfsc_drake.physics.joint_sensors import JointTorqueSensor, TorqueSensorOptions
from pfsc_drake.robot.robot_model import gravity_function
from tests.control.estimation.conftest import BEARINGS, DAMPING

PERIOD, COUNT, PREDICTED = 1e-3, 120, 60
NOTHING = np.zeros(3)


def moved(arm):
    """Return drives and states of the arm, driven by torques that change slowly."""
    turns = np.linspace(0.0, 2.0, COUNT)[:, None]
    drives = np.array([120.0, -300.0, 80.0]) * np.sin(turns)
    return drives, np.array(arm.move(drives, lambda _: NOTHING, lambda _: NOTHING, PERIOD))


def measured_torques(chain, states, **options):
    sensor = Stepper(JointTorqueSensor(chain, TorqueSensorOptions(**options)))
    return np.array([sensor.step(joint_state=x)["joint_torque"] for x in states])


def motors_only(states):
    """Return states whose links' side is not known."""
    hidden = states.copy()
    hidden[:, :6] = np.nan
    return hidden


@pytest.mark.parametrize("kind", ["elastic", "mixed"])
def test_torques_tell_where_the_links_are(drake_arm, kind):
    arm = drake_arm(kind)
    _, states = moved(arm)
    torques = measured_torques(arm.chain, states)
    inputs = motors_only(states)
    inputs[:, :6] = np.where(np.tile(arm.chain.elastic_joints, 2), np.nan, states[:, 6:])
    found = Stepper(LinkState(arm.chain, 800.0, PERIOD))
    links = np.array(
        [
            found.step(joint_state=x, joint_torque=tau)["joint_state"]
            for x, tau in zip(inputs, torques, strict=True)
        ]
    )
    np.testing.assert_array_equal(links[:, 6:], states[:, 6:])
    settled = slice(20, None)
    deflection = np.abs(states[:, 6:9] - states[:, :3]).max()
    assert deflection > 1e-3
    np.testing.assert_allclose(links[settled, :3], states[settled, :3], rtol=0, atol=5e-6)
    swing = np.abs(states[settled, 9:] - states[settled, 3:6]).max()
    assert swing > 0.3
    np.testing.assert_allclose(links[settled, 3:6], states[settled, 3:6], rtol=0, atol=3e-3)


def test_a_robot_at_rest_is_at_rest_from_the_first_tick(drake_arm):
    """Its springs carry the weight: links and motors have different positions."""
    arm = drake_arm("elastic")
    q = np.array([0.3, 1.3, -0.5])
    weight = gravity_function(arm.chain)(q).full().ravel()
    state = np.concatenate([q, NOTHING, q + weight / arm.chain.K_s, NOTHING])
    found = Stepper(LinkState(arm.chain, 800.0, PERIOD))
    assert np.abs(weight / arm.chain.K_s).max() > 1e-3
    for _ in range(3):
        link_state = found.step(joint_state=motors_only(state[None])[0], joint_torque=weight)
        np.testing.assert_allclose(link_state["joint_state"], state, rtol=0, atol=1e-10)


def test_links_are_expected_where_springs_move_them_that_bend_meanwhile(drake_arm):
    """At first all torques are in balance; motors that turn bend the springs from then on."""
    arm, v_M = drake_arm("elastic"), np.array([0.3, -0.2, 0.4])
    q = np.array([0.3, 1.3, -0.5])
    weight = gravity_function(arm.chain)(q).full().ravel()
    state = np.concatenate([q, NOTHING, q + (weight - DAMPING * v_M) / arm.chain.K_s, v_M])
    drive = weight + BEARINGS * v_M
    np.testing.assert_allclose(
        arm.rates(state, drive, NOTHING, NOTHING)[[3, 4, 5, 9, 10, 11]], 0.0, atol=1e-8
    )
    later = solve_ivp(
        lambda _, x: arm.rates(x, drive, NOTHING, NOTHING),
        (0.0, PERIOD),
        state,
        rtol=1e-10,
        atol=1e-13,
    ).y[:, -1]
    found = Stepper(LinkState(arm.chain, 800.0, PERIOD))
    inputs = {"joint_state": state, "joint_torque": weight}
    found.start(**inputs)
    found.set_state("prediction", np.concatenate([q, NOTHING, NOTHING]))
    found.step(**inputs)
    expected = found.states["prediction"][:6]
    np.testing.assert_allclose(expected[3:], later[3:6], rtol=0.1)
    assert np.all(np.abs(expected[:3] - later[:3]) < 0.2 * PERIOD * np.abs(later[3:6]))


def test_forces_that_nobody_knows_are_found_as_accelerations(drake_arm):
    arm = drake_arm("elastic")
    turns = np.linspace(0.0, 2.0, COUNT)[:, None]
    drives = np.array([120.0, -300.0, 80.0]) * np.sin(turns)
    push = np.array([40.0, -60.0, 30.0])
    states = np.array(arm.move(drives, lambda _: NOTHING, lambda _: push, PERIOD))
    found = Stepper(LinkState(arm.chain, 800.0, PERIOD))
    torques = measured_torques(arm.chain, states)
    links = np.array(
        [
            found.step(joint_state=x, joint_torque=tau)["joint_state"]
            for x, tau in zip(motors_only(states), torques, strict=True)
        ]
    )
    moved_by = np.abs(states[40:, 3:6] - moved(arm)[1][40:, 3:6]).max()
    assert moved_by > 0.3
    np.testing.assert_allclose(links[40:, 3:6], states[40:, 3:6], rtol=0, atol=5e-3)


def test_a_sensor_with_a_wrong_scale_shifts_the_links_by_its_share(drake_arm):
    arm = drake_arm("elastic")
    _, states = moved(arm)
    true, wrong = (measured_torques(arm.chain, states, scale=s) for s in (0.0, 0.02))
    np.testing.assert_allclose(wrong, 1.02 * true, rtol=1e-12)
    links = LinkState(arm.chain, 800.0, PERIOD)
    first = [
        Stepper(links).step(joint_state=states[0], joint_torque=tau[0])["joint_state"][:3]
        for tau in (true, wrong)
    ]
    np.testing.assert_allclose(first[0] - first[1], 0.02 * true[0] / arm.chain.K_s, atol=1e-12)


def test_springs_are_observed_by_what_they_do_to_the_motors(drake_arm):
    """The estimate follows with a lag of first order, by 1 / L."""
    arm, rate = drake_arm("elastic"), 800.0
    drives, states = moved(arm)
    torques = measured_torques(arm.chain, states)
    observer = Stepper(
        MomentumObserver(motor_momentum(arm.chain, (NOTHING, NOTHING)), rate, PERIOD),
        ("known_torque",),
    )
    found = np.array(
        [
            observer.step(joint_state=x, drive_torque=tau, known_torque=torques[0])["estimate"]
            for x, tau in zip(motors_only(states), [*drives, drives[-1]], strict=True)
        ]
    )
    assert np.isfinite(found).all()
    found += torques[0]
    expected = np.empty_like(torques)
    expected[0], weight = torques[0], 1.0 - np.exp(-rate * PERIOD)
    means = (torques[1:] + torques[:-1]) / 2.0
    for k in range(1, len(torques)):
        expected[k] = expected[k - 1] + weight * (means[k - 1] - expected[k - 1])
    swing = np.ptp(torques, axis=0).max()
    assert swing > 30.0
    np.testing.assert_allclose(found, expected, rtol=0, atol=0.01 * swing)


def test_unmodelled_friction_is_taken_for_a_spring(drake_arm):
    arm = drake_arm("elastic")
    model = motor_momentum(arm.chain, (np.array([5.0, 0.0, 0.0]), NOTHING))
    state = np.zeros(12)
    state[9] = 0.5
    _, forces = model.function(state)
    expected = -5.0 - arm.chain.viscous_damping[0] * 0.5
    assert float(forces[0]) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("options", [{"scale": 0.6}, {"noise": -1.0}])
def test_sensors_out_of_range(options):
    with pytest.raises(InputError, match="allowed"):
        TorqueSensorOptions(**options)


def drives():
    turns = np.linspace(0.0, 6.0, PREDICTED)[:, None]
    return np.array([120.0, -300.0, 80.0]) * np.cos(turns)


def predicted_states(predictor, states, commands, **more):
    """Return the predictions for states and commanded torques."""
    stepper = Stepper(predictor, tuple(more))
    return np.array(
        [
            stepper.step(joint_state=x, drive_torque=tau, **{k: v[i] for k, v in more.items()})[
                "joint_state"
            ]
            for i, (x, tau) in enumerate(zip(states, commands, strict=False))
        ]
    )


@pytest.mark.slow(but=["1-elastic", "2-mixed", "3-rigid"])
@pytest.mark.parametrize("kind", ["rigid", "elastic", "mixed"])
@pytest.mark.parametrize("ticks", [1, 2, 3])
def test_the_state_is_that_of_so_many_ticks_later(drake_arm, kind, ticks):
    """The arm applies the torques that were commanded ``ticks`` before."""
    arm, sent = drake_arm(kind), drives()
    states = np.array(arm.move(sent, lambda _: NOTHING, lambda _: NOTHING, PERIOD))
    # torques from tick k on were commanded at tick k - ticks
    found = predicted_states(
        StatePredictor(arm.chain, ticks, PERIOD), states, [*sent[ticks:], *sent]
    )
    settled = slice(ticks + 1, PREDICTED - ticks)
    later = states[settled.start + ticks : PREDICTED]
    scale = np.repeat([1.0, 100.0, 1.0, 100.0], 3)
    ahead = np.abs((found[settled] - later) / scale).max()
    unpredicted = np.abs((states[settled] - later) / scale).max()
    assert unpredicted > 5e-4
    assert ahead < 0.02 * unpredicted


def test_springs_are_exact_and_inertia_is_that_of_the_middle(drake_arm):
    """Against the matrix exponential of Drake's linearized system there."""
    arm, ticks = drake_arm("elastic"), 3
    state, K_s, n = arm.state(), arm.chain.K_s, 3
    v, middle = state[3:6], state[:3] + 0.5 * ticks * PERIOD * state[3:6]
    tau = gravity_function(arm.chain)(state[:3]).full().ravel()

    def accelerated(bend):
        there = np.concatenate([middle, v, middle + bend, v])
        return arm.rates(there, NOTHING, NOTHING, NOTHING)[3:6]

    falling = accelerated(NOTHING)
    inverse = np.column_stack(
        [(accelerated(e) - falling) / k for e, k in zip(np.eye(n), K_s, strict=True)]
    )
    spring = np.hstack([-np.diag(K_s), -np.diag(DAMPING), np.diag(K_s), np.diag(DAMPING)])
    A = np.zeros((4 * n + 1, 4 * n + 1))
    A[:n, n : 2 * n] = A[2 * n : 3 * n, 3 * n : -1] = np.eye(n)
    A[n : 2 * n, :-1], A[n : 2 * n, -1] = inverse @ spring, falling
    A[3 * n : -1, :-1] = -spring / arm.chain.D_M[:, None]
    A[3 * n : -1, 3 * n : -1] -= np.diag(BEARINGS / arm.chain.D_M)
    A[3 * n : -1, -1] = tau / arm.chain.D_M
    expected = (scipy.linalg.expm(ticks * PERIOD * A) @ [*state, 1.0])[:-1]
    found = predicted_states(StatePredictor(arm.chain, ticks, PERIOD), [state], [tau])[0]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("kind", ["rigid", "elastic"])
def test_velocities_of_difference_quotients_are_brought_up_to_positions(drake_arm, kind):
    arm, sent = drake_arm(kind), drives()
    states = np.array(arm.move(sent, lambda _: NOTHING, lambda _: NOTHING, PERIOD))
    late = states[1:].copy()
    for position, velocity in ((slice(0, 3), slice(3, 6)), (slice(6, 9), slice(9, 12))):
        late[:, velocity] = np.diff(states[:, position], axis=0) / PERIOD
    found = predicted_states(StatePredictor(arm.chain, 0, PERIOD, PERIOD / 2), late, sent[1:])
    error = np.abs(found - states[1:PREDICTED])[1:, [3, 4, 5, 9, 10, 11]].max()
    before = np.abs(late[:-1] - states[1:PREDICTED])[1:, [3, 4, 5, 9, 10, 11]].max()
    assert before > 0.01
    assert error < 0.05 * before
    np.testing.assert_allclose(found[:, 6:9], late[:-1, 6:9], rtol=0, atol=1e-15)


@pytest.mark.parametrize(("ticks", "age"), [(0, 1e-3), (2, 0.8e-3)])
def test_inertia_is_that_of_the_middle_between_old_velocities_and_the_end(drake_arm, ticks, age):
    """A rigid arm whose weight is compensated: ``v + (age + ticks T) D^-1 (tau - n)``, by Drake."""
    arm = drake_arm("rigid")
    state, v = arm.state(), 5.0 * arm.state()[3:6]
    state[3:6] = state[9:] = v
    tau = gravity_function(arm.chain)(state[:3]).full().ravel()

    def reached(shift):
        q = state[:3] + shift * v
        at = np.concatenate([q, v, q, v])
        return v + (age + ticks * PERIOD) * arm.rates(at, tau, NOTHING, NOTHING)[3:6]

    found = predicted_states(StatePredictor(arm.chain, ticks, PERIOD, age), [state], [tau])[0][3:6]
    middle = 0.5 * (ticks * PERIOD - age)
    scale = np.abs(reached(middle) - reached(0.5 * ticks * PERIOD)).max()
    assert scale > 1e-5
    np.testing.assert_allclose(found, reached(middle), rtol=0, atol=0.1 * scale)


def test_estimated_friction_is_subtracted(drake_arm):
    arm, sent, f = drake_arm("elastic"), drives(), np.array([30.0, -40.0, 20.0])
    states = np.array(arm.move(sent, lambda _: f, lambda _: NOTHING, PERIOD))[:PREDICTED]
    rubbing = np.tile(f, (PREDICTED, 1))
    later = slice(5, PREDICTED - 2)
    with_it = predicted_states(
        StatePredictor(arm.chain, 2, PERIOD), states, [*sent[2:], *sent], friction_torque=rubbing
    )[later]
    without = predicted_states(StatePredictor(arm.chain, 2, PERIOD), states, [*sent[2:], *sent])[
        later
    ]
    true = states[7:PREDICTED]
    assert np.abs(with_it - true)[:, 9:].max() < 0.03 * np.abs(without - true)[:, 9:].max()


def test_a_robot_at_rest_stays_at_rest(drake_arm):
    """Initially the pending torques carry the weight."""
    arm = drake_arm("elastic")
    q = np.array([0.3, 1.3, -0.5])
    weight = gravity_function(arm.chain)(q).full().ravel()
    state = np.concatenate([q, NOTHING, q + weight / arm.chain.K_s, NOTHING])
    found = predicted_states(StatePredictor(arm.chain, 3, PERIOD), [state], [weight])[0]
    np.testing.assert_allclose(found, state, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("ticks", "age", "message"), [(-1, 0.0, "-1 ticks"), (11, 0.0, "11 ticks"), (1, 2e-3, "0.002")]
)
def test_numbers_out_of_range(drake_arm, ticks, age, message):
    with pytest.raises(InputError, match=message):
        StatePredictor(drake_arm("rigid").chain, ticks, PERIOD, age)


def test_what_is_not_measured_is_not_foretold(drake_arm):
    """The measured state is passed through for a stop; afterwards all is predicted again."""
    arm = drake_arm("elastic")
    states = np.array(arm.move(drives(), lambda _: NOTHING, lambda _: NOTHING, PERIOD))[:3]
    whole = predicted_states(StatePredictor(arm.chain, 2, PERIOD), states, drives())
    states[1, 7] = np.nan
    found = predicted_states(StatePredictor(arm.chain, 2, PERIOD), states, drives())
    np.testing.assert_array_equal(found[1], states[1])
    np.testing.assert_array_equal(found[[0, 2]], whole[[0, 2]])
