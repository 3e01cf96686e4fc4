"""A device in a hand: its mass and friction, how it turns, its encoders."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.errors import InputError
from pfsc_drake.physics.leader_device import (
    LeaderDevice,
    LeaderParameters,
    LeaderWrist,
    WristParameters,
)

T = 1e-3


def test_the_handle_moves_as_a_mass_with_friction():
    """Against an adaptive integration, the force never letting it rest."""
    device = LeaderParameters(mass=0.4, damping=2.0, friction=0.5, resolution=0.0)
    stepper = Stepper(LeaderDevice(device, T))
    force, motor = np.array([4.0, -3.0, 2.0]), np.array([-1.0, 0.5, 0.0])
    for _ in range(401):
        row = stepper.step(motor_force=motor, hand_wrench=[*force, 0, 0, 0])
    total = force + motor
    truth = solve_ivp(
        lambda t, y: np.concatenate([y[3:], (total - 2.0 * y[3:] - 0.5 * np.sign(total)) / 0.4]),
        (0.0, 0.4), np.zeros(6), rtol=1e-10, atol=1e-12,
    )  # fmt: skip
    np.testing.assert_allclose(row["state"], truth.y[:, -1], rtol=3e-3)


def test_friction_holds_it():
    stepper = Stepper(LeaderDevice(LeaderParameters(friction=0.3), T))
    for _ in range(10):
        row = stepper.step(motor_force=[0.29, 0, 0], hand_wrench=np.zeros(6))
    np.testing.assert_array_equal(row["state"], 0.0)


def test_work_on_it_is_never_less_than_what_it_gains():
    random = np.random.default_rng(1)
    stepper = Stepper(LeaderDevice(LeaderParameters(mass=0.3), T))
    work, last = 0.0, np.zeros(6)
    force = np.zeros(3)
    for _ in range(500):
        before = force
        force = random.normal(0, 10, 3)
        row = stepper.step(motor_force=0.3 * force, hand_wrench=[*(0.7 * force), 0, 0, 0])
        work += before @ (row["state"][:3] - last[:3])
        last = row["state"]
        assert 0.15 * last[3:] @ last[3:] <= work + 1e-12


def test_encoders_tell_whole_steps():
    stepper = Stepper(LeaderDevice(LeaderParameters(resolution=1e-4, friction=0.0), T))
    for _ in range(50):
        row = stepper.step(motor_force=np.zeros(3), hand_wrench=[1.0, -2.0, 0.5, 0, 0, 0])
    steps = row["position"] / 1e-4
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    np.testing.assert_allclose(row["position"], row["state"][:3], atol=0.5001e-4)


def matrix(rows):
    return np.reshape(rows, (3, 3))


def test_the_wrist_turns_as_a_body_with_friction():
    """Against an adaptive integration of w and of R, about an axis that wanders."""
    wrist = WristParameters(inertia=0.01, damping=0.02, friction=0.05, resolution=0.0)
    stepper = Stepper(LeaderWrist(wrist, T))
    hand, motor = np.array([0.3, -0.2, 0.15]), np.array([-0.1, 0.05, 0.0])
    for _ in range(401):
        row = stepper.step(motor_moment=motor, hand_wrench=[0, 0, 0, *hand])

    def rates(t, y):
        w = y[:3]
        turned = np.cross(np.eye(3), w) @ matrix(y[3:])
        return [*((hand + motor - 0.02 * w - 0.05 * np.sign(hand)) / 0.01), *turned.ravel()]

    begin = [0.0, 0.0, 0.0, *np.eye(3).ravel()]
    truth = solve_ivp(rates, (0.0, 0.4), begin, rtol=1e-10, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(row["state"][9:], truth[:3], rtol=2e-3)
    np.testing.assert_allclose(row["state"][:9], truth[3:], atol=6e-3)
    assert np.linalg.norm(truth[:3]) > 3.0


def test_work_on_the_wrist_is_never_less_than_what_it_gains():
    random, stepper = np.random.default_rng(2), Stepper(LeaderWrist(WristParameters(), T))
    work, R, moment = 0.0, np.eye(3), np.zeros(3)
    for _ in range(300):
        before = moment
        moment = random.normal(0, 1.0, 3)
        row = stepper.step(motor_moment=0.4 * moment, hand_wrench=[0, 0, 0, *(0.6 * moment)])
        turned = Rotation.from_matrix(matrix(row["state"][:9]) @ R.T).as_rotvec()
        work, R = work + before @ turned, matrix(row["state"][:9])
        w = row["state"][9:]
        assert 0.5 * WristParameters().inertia * w @ w <= work + 1e-12
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-13)


def test_encoders_of_the_wrist_tell_whole_steps():
    stepper = Stepper(LeaderWrist(WristParameters(resolution=1e-3), T))
    for _ in range(60):
        row = stepper.step(motor_moment=np.zeros(3), hand_wrench=[0, 0, 0, 0.5, -0.2, 0.1])
    steps = Rotation.from_matrix(matrix(row["orientation"])).as_rotvec() / 1e-3
    assert np.abs(steps).max() > 10.0
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    true = Rotation.from_matrix(matrix(row["state"][:9])).as_rotvec() / 1e-3
    np.testing.assert_allclose(steps, true, atol=0.5001)


@pytest.mark.parametrize(
    "wrong", [{"mass": 0.0}, {"friction": -0.1}, {"resolution": np.inf}, {"force_limit": 0.0}]
)
def test_wrong_devices_are_refused(wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        LeaderParameters(**wrong)


@pytest.mark.parametrize("wrong", [{"inertia": 0.0}, {"friction": -0.1}, {"torque_limit": 0.0}])
def test_wrong_wrists_are_refused(wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        WristParameters(**wrong)
