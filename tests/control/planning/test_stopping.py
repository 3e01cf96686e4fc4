"""Stopping bandwidth within the drive limits, against a closed form for a sliding mass."""

import numpy as np
import pytest

from pfsc_drake.control.obstacles.stoppable_scaling import StoppableScaling
from pfsc_drake.control.planning.drive_demand import DriveDemand
from pfsc_drake.control.planning.stopping import stopping_bandwidth
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.links import ChainLink

MASS, SPEED, STEP = 4.0, 0.5, 0.01


def _trajectory(count=400):
    times = STEP * np.arange(count)
    trajectory = np.zeros((count, 3, 1))
    trajectory[:, 0, 0], trajectory[:, 1, 0] = SPEED * times, SPEED
    return trajectory


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
    trajectory = _trajectory()
    allowed = np.tile([force, 10.0], (len(trajectory), 1))
    return stopping_bandwidth(demand, trajectory, STEP, allowed, order)


@pytest.mark.parametrize(("order", "steepest"), [(2, np.exp(-1.0)), (4, 4.5 * np.exp(-3.0))])
def test_a_mass_brakes_with_the_allowed_force(order, steepest):
    """The scaling changes by ``omega max h`` at most, ``h = x^(r-1) e^-x / (r-1)!``."""
    force = 10.0
    expected = force / (MASS * SPEED * steepest)
    assert _bandwidth(force, order) == pytest.approx(expected, rel=0.04)
    # found from below: the result is within the limit
    _, rates = StoppableScaling(order, _bandwidth(force, order), 0.1).stop(np.linspace(0, 10, 500))
    assert MASS * SPEED * np.abs(rates[:, 1]).max() <= force * 1.01


def test_bandwidth_stays_within_the_search_interval():
    assert _bandwidth(1e6, 4) == 60.0
    assert _bandwidth(1e-3, 4) == 2.0


@pytest.mark.parametrize("up", [1.0, -1.0])
def test_gravity_limits_stops_or_restarts(up):
    """Gravity opposes restarts upwards and stops downwards."""
    weight = 9.81 * MASS
    force = weight + 10.0
    expected = 10.0 / (MASS * SPEED * np.exp(-1.0))
    assert _bandwidth(force, 2, (0.0, 0.0, up)) == pytest.approx(expected, rel=0.04)
