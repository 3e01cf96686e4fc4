"""How quickly a motion stops within its drives' limits, in closed form for a mass that slides."""

import numpy as np
import pytest

from pfsc_drake.control.obstacles.waiting_pace import WaitingPace
from pfsc_drake.control.planning.drive_demand import DriveDemand
from pfsc_drake.control.planning.stopping import stopping_bandwidth
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.links import ChainLink

MASS, SPEED, STEP = 4.0, 0.5, 0.01


def _course(count=400):
    times = STEP * np.arange(count)
    course = np.zeros((count, 3, 1))
    course[:, 0, 0], course[:, 1, 0] = SPEED * times, SPEED
    return course


def _bandwidth(force, order, axis=(1.0, 0.0, 0.0)):
    slide = ChainLink(
        "slide",
        "prismatic",
        np.eye(3),
        np.zeros(3),
        np.array(axis),
        MASS,
        np.zeros(3),
        np.eye(3),
    )
    demand = DriveDemand(SerialChain((slide,)), "rigid")
    course = _course()
    allowed = np.tile([force, 10.0], (len(course), 1))
    return stopping_bandwidth(demand, course, STEP, allowed, order)


@pytest.mark.parametrize(("order", "steepest"), [(2, np.exp(-1.0)), (4, 4.5 * np.exp(-3.0))])
def test_a_mass_brakes_with_the_force_that_it_has(order, steepest):
    """The pace changes by ``omega max h`` at most, ``h = x^(r-1) e^-x / (r-1)!``."""
    force = 10.0
    expected = force / (MASS * SPEED * steepest)
    assert _bandwidth(force, order) == pytest.approx(expected, rel=0.04)
    # found from below: what is found fits
    _, rates = WaitingPace(order, _bandwidth(force, order), 0.1).stop(np.linspace(0, 10, 500))
    assert MASS * SPEED * np.abs(rates[:, 1]).max() <= force * 1.01


def test_it_stays_within_what_is_looked_for():
    assert _bandwidth(1e6, 4) == 60.0
    assert _bandwidth(1e-3, 4) == 2.0


@pytest.mark.parametrize("up", [1.0, -1.0])
def test_setting_off_upwards_takes_more_than_stopping(up):
    """Weight acts besides: upwards it brakes, and downwards it sets off."""
    weight = 9.81 * MASS
    force = weight + 10.0
    expected = 10.0 / (MASS * SPEED * np.exp(-1.0))
    assert _bandwidth(force, 2, (0.0, 0.0, up)) == pytest.approx(expected, rel=0.04)
