"""A device in a hand: its mass and friction, its encoders, its clutch."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.errors import InputError
from pfsc_drake.physics.leader_device import (
    Clutch,
    ClutchParameters,
    LeaderDevice,
    LeaderParameters,
)

T = 1e-3
START = [0.9, 0.1, 1.0]


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


def test_a_clutch_scales_and_lets_loose():
    """While open the follower's place stays, and the handle may go back; then it goes on."""
    clutch = Stepper(Clutch(2.0, START, [ClutchParameters(0.010, 0.020)], T))
    handle = np.concatenate([np.linspace(0, 0.011, 12), np.linspace(0.01, 0.002, 9)])
    handle = np.append(handle, 0.002 + 0.001 * np.arange(1, 10))
    rows = [clutch.step(handle=[x, 0.0, 0.0]) for x in handle]
    place = np.array([row["position"] for row in rows]) - START
    np.testing.assert_allclose(place[:11, 0], 2.0 * handle[:11], atol=1e-12)
    np.testing.assert_allclose(place[11:21, 0], 2.0 * handle[10], atol=1e-12)
    further = handle[21:] - handle[20]
    np.testing.assert_allclose(place[21:, 0], 2.0 * (handle[10] + further), atol=1e-12)
    grip = np.array([row["grip"][0] for row in rows])
    assert (grip[:10] == 1.0).all()
    assert (grip[10:20] == 0.0).all()
    assert 0.0 < grip[22] < grip[29] < 1.0


def test_a_hand_at_an_open_clutch_goes_back_to_the_middle():
    """What it sees is beside its target by the way of the handle."""
    clutch = Stepper(Clutch(1.0, START, [ClutchParameters(0.0, 1.0)], T))
    for _ in range(300):
        row = clutch.step(handle=[0.03, 0.0, -0.01])
    np.testing.assert_allclose(row["pose"][:3] - row["position"], [0.03, 0.0, -0.01], atol=1e-12)
    np.testing.assert_array_equal(row["pose"][3:], np.eye(3).ravel())


def test_a_person_opens_it_too():
    clutch = Stepper(Clutch(1.0, START, [], T), ("opened",))
    clutch.step(handle=[0.0, 0, 0], opened=[1.0])
    row = clutch.step(handle=[0.01, 0, 0], opened=[1.0])
    np.testing.assert_allclose(row["position"], START)
    assert row["grip"][0] == 0.0


@pytest.mark.parametrize(
    "wrong", [{"mass": 0.0}, {"friction": -0.1}, {"resolution": np.inf}, {"force_limit": 0.0}]
)
def test_wrong_devices_are_refused(wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        LeaderParameters(**wrong)


def test_a_clutch_closes_after_it_opened():
    with pytest.raises(InputError, match="ascending"):
        ClutchParameters(2.0, 1.0)
