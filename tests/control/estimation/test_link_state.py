"""The links' side of elastic joints, against plants that Drake moved."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.estimation.link_state import LinkState
from pfsc_drake.control.estimation.momentum import MomentumObserver, motor_momentum
from pfsc_drake.errors import InputError
from pfsc_drake.physics.joint_torque_sensor import JointTorqueSensor, TorqueSensorOptions
from pfsc_drake.robot.robot_model import gravity_function
from tests.control.estimation.conftest import BEARINGS, DAMPING

PERIOD, COUNT = 1e-3, 120
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
    given = motors_only(states)
    given[:, :6] = np.where(np.tile(arm.chain.elastic_joints, 2), np.nan, states[:, 6:])
    found = Stepper(LinkState(arm.chain, 800.0, PERIOD))
    links = np.array(
        [
            found.step(joint_state=x, joint_torque=tau)["joint_state"]
            for x, tau in zip(given, torques, strict=True)
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
    """Its springs bear the weight: the links are not where the motors are."""
    arm = drake_arm("elastic")
    q = np.array([0.3, 1.3, -0.5])
    weight = gravity_function(arm.chain)(q).full().ravel()
    state = np.concatenate([q, NOTHING, q + weight / arm.chain.K_s, NOTHING])
    found = Stepper(LinkState(arm.chain, 800.0, PERIOD))
    assert np.abs(weight / arm.chain.K_s).max() > 1e-3
    for _ in range(3):
        told = found.step(joint_state=motors_only(state[None])[0], joint_torque=weight)
        np.testing.assert_allclose(told["joint_state"], state, rtol=0, atol=1e-10)


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
    given = {"joint_state": state, "joint_torque": weight}
    found.start(**given)
    found.set_state("prediction", np.concatenate([q, NOTHING, NOTHING]))
    found.step(**given)
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


def test_friction_that_is_not_believed_is_taken_for_a_spring(drake_arm):
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
