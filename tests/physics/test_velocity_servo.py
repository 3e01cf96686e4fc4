"""The servo's law on a single inertia, sampled exactly."""

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.physics.velocity_servo import (
    ServoGains,
    VelocityServoLaw,
    joint_inertia,
    servo_gains,
)
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.links import ChainLink

J, OMEGA, T = 2.0, 100.0, 1e-3


def simulate(law, reference, load=0.0, steps=2000):
    """Return velocities and torques of an inertia under the law and a load torque."""
    v, x, velocities, torques = np.zeros(1), np.zeros(1), [], []
    for k in range(steps):
        tau, x = law.torque(v, reference(k * T), 0.0, x)
        velocities.append(v[0])
        torques.append(float(tau))
        v = v + T / J * (tau.full()[0] - load)
    return np.array(velocities), np.array(torques)


@pytest.mark.slow
def test_step_is_a_first_order_lag():
    """``1 - exp(-omega t)`` at every tick, whatever the rate of the integral part."""
    for rate in (None, 0.0, 90.0):
        law = VelocityServoLaw(servo_gains([J], OMEGA, T, rate), [np.inf])
        v, _ = simulate(law, lambda t: 0.3)
        expected = 0.3 * (1.0 - np.exp(-OMEGA * T * np.arange(len(v))))
        assert np.allclose(v, expected, rtol=0, atol=1e-12)


def test_load_is_removed():
    law = VelocityServoLaw(servo_gains([J], OMEGA, T), [np.inf])
    v, tau = simulate(law, lambda t: 0.3, load=40.0)
    assert np.isclose(v[-1], 0.3, rtol=0, atol=1e-9)
    assert np.isclose(tau[-1], 40.0, rtol=0, atol=1e-6)


def test_does_not_wind_up():
    """A step that needs twenty times the torque limit is reached without overshoot."""
    law = VelocityServoLaw(servo_gains([J], OMEGA, T), [10.0])
    v, tau = simulate(law, lambda t: 1.0 if t < 1.0 else 0.0)
    assert np.max(np.abs(tau)) == 10.0
    assert np.max(v) <= 1.0 + 1e-9
    # saturated acceleration, then one time constant
    reached = np.argmax(v > 0.99) * T
    assert np.isclose(reached, J / 10.0, rtol=0, atol=0.05)
    assert np.min(v) >= -1e-9 and abs(v[-1]) < 1e-6


def test_gravity_is_fed_forward():
    law = VelocityServoLaw(servo_gains([J], OMEGA, T), [50.0])
    tau, x = law.torque(np.zeros(1), np.zeros(1), np.array([30.0]), np.zeros(1))
    assert tau[0] == 30.0 and x[0] == 0.0
    tau, _ = law.torque(np.zeros(1), np.zeros(1), np.array([70.0]), np.zeros(1))
    assert tau[0] == 50.0


def test_inertia_that_a_drive_sees():
    """Two equal pendulums in line: D_E by hand, plus the rotors."""
    m, length, spin, rotor = 3.0, 0.5, 0.02, 0.7
    eye, axis = np.eye(3), np.array([0.0, 0.0, 1.0])
    links = tuple(
        ChainLink(
            f"j{i}",
            "revolute",
            eye,
            np.array([length * i, 0.0, 0.0]),
            axis,
            m,
            np.array([length, 0.0, 0.0]),
            spin * eye,
            reflected_inertia=rotor,
        )
        for i in range(2)
    )
    second = spin + m * length**2
    q = 0.6
    far = length**2 * (2.0 + 2.0 * np.cos(q))
    first = second + spin + m * far
    got = joint_inertia(SerialChain(links), np.array([0.2, q]))
    assert np.allclose(got, [first + rotor, second + rotor], rtol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (([0.0], OMEGA, T), r"inertia = \[0.0\]; must be positive"),
        (([J], -1.0, T), "bandwidth"),
        (([J], 2000.0, T), "bandwidth = 2000 rad/s; must be at most 1/period = 1000 rad/s"),
        (([J], OMEGA, 0.0), "period = 0.0 s"),
        (([J], OMEGA, T, -1.0), "integral_rate"),
    ],
)
def test_wrong_tuning(arguments, named):
    with pytest.raises(InputError, match=named) as error:
        servo_gains(*arguments)
    assert "\n" not in str(error.value)


def test_wrong_gains_and_limits():
    with pytest.raises(InputError, match=r"integral of shape \(2,\); must be \(1,\)"):
        ServoGains([1.0], [1.0, 2.0], [1.0], T)
    with pytest.raises(InputError, match="period = nan s"):
        ServoGains([1.0], [1.0], [1.0], np.nan)
    gains = servo_gains([J], OMEGA, T)
    for limits in ([0.0], [1.0, 2.0], [np.nan]):
        with pytest.raises(InputError, match="must be 1 positive torques"):
            VelocityServoLaw(gains, limits)
