"""Command handling of drivers."""

import numpy as np
import pytest

from pfsc_drake.drivers.driver_rules import DriverOptions, DriverRules
from pfsc_drake.drivers.messages import ControlMode, RobotCommand, RobotMode
from pfsc_drake.errors import InputError
from pfsc_drake.physics.driver import torque_rates

PERIOD = 1e-3
STILL = np.zeros(2)


def rules(mode=ControlMode.TORQUE, **options):
    driver_options = DriverOptions(**({"low_pass": 0.0} | options))
    return DriverRules(np.array([1.0, 2.0]), np.array([80.0, 10.0]), mode, driver_options, PERIOD)


def torque(utime, *values, mode=ControlMode.TORQUE):
    return RobotCommand(utime, mode, np.array(values))


def test_a_torque_comes_up_no_faster_than_it_may():
    driver = rules(torque_rate=1000.0)
    for k, expected in enumerate([1.0, 2.0, 3.0, 3.5, 3.5]):
        acting = driver.advance(1000 * k, torque(1000 * k, 3.5, -0.5), STILL)
        np.testing.assert_allclose(acting, [expected, -0.5], atol=1e-12)


def test_strong_joints_have_a_larger_torque_rate():
    rates = torque_rates(1000.0, np.array([87.0, 12.0, 600.0, np.inf]))
    np.testing.assert_array_equal(rates, [1000.0, 1000.0, 6000.0, 1000.0])


def test_torques_pass_a_filter_of_first_order():
    """A step is followed as the closed form says, to the step of the sampling."""
    driver = rules(low_pass=30.0, torque_rate=1e9)
    found = [driver.advance(1000 * k, torque(1000 * k, 1.0, 0.0), STILL)[0] for k in range(40)]
    w = 2.0 * np.pi * 30.0 * PERIOD
    np.testing.assert_allclose(found, 1.0 - (1.0 + w) ** -np.arange(1.0, 41.0), rtol=1e-12)


def test_old_commands_do_not_count_and_the_joints_are_damped():
    driver, v = rules(torque_rate=1e9, damping=10.0), np.array([0.5, -1.0])
    driver.advance(0, torque(0, 5.0, 5.0), v)
    np.testing.assert_array_equal(driver.advance(100_000, None, v), [5.0, 5.0])
    np.testing.assert_array_equal(driver.advance(101_000, None, v), [-5.0, 20.0])
    np.testing.assert_array_equal(driver.advance(102_000, torque(1000, 7.0, 7.0), v), [-5.0, 20.0])
    assert driver.rejected == 1
    assert driver.ended is None


def test_commands_of_a_clock_that_was_ahead_do_not_count():
    """A robot that starts anew counts from zero: what came before is of another time."""
    driver = rules(torque_rate=1e9)
    driver.advance(0, torque(0, 1.0, 1.0), STILL)
    acting = driver.advance(1000, torque(5_000_000, 9.0, 9.0), STILL)
    np.testing.assert_array_equal(acting, [1.0, 1.0])
    assert driver.rejected == 1


def test_velocities_end_with_the_commands():
    driver = rules(ControlMode.VELOCITY)
    command = torque(0, 0.3, -0.1, mode=ControlMode.VELOCITY)
    np.testing.assert_array_equal(driver.advance(0, command, STILL), [0.3, -0.1])
    np.testing.assert_array_equal(driver.advance(200_000, None, STILL), [0.0, 0.0])


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        (torque(0, 1.0, 1.0, mode=ControlMode.VELOCITY), "for VELOCITY, the driver is in TORQUE"),
        (torque(0, 1.0, 1.0, 1.0), "for 3 joints, the robot has 2"),
        (torque(0, 1.0, np.nan), "not a finite number"),
    ],
)
def test_what_ends_a_driver(command, reason):
    driver, v = rules(torque_rate=1e9), np.array([1.0, 0.0])
    assert driver.robot_mode is RobotMode.MOVE
    np.testing.assert_array_equal(driver.advance(0, command, v), [-10.0, 0.0])
    assert reason in driver.ended
    assert driver.robot_mode is RobotMode.REFLEX
    # nothing is taken any more, and the first reason stays
    for later in (torque(1000, 3.0, 3.0), torque(1000, *np.ones(5))):
        np.testing.assert_array_equal(driver.advance(1000, later, v), [-10.0, 0.0])
    assert reason in driver.ended


@pytest.mark.parametrize("options", [{"expiry": 0.0}, {"low_pass": -1.0}, {"torque_rate": np.nan}])
def test_options_out_of_range(options):
    with pytest.raises(InputError, match="allowed"):
        DriverOptions(**options)
