"""The inertia behind a force sensor: against Drake, and its limit for a stable compliance."""

from pathlib import Path

import numpy as np
import pytest

from diagrams.robots.arm_model import read_arm
from diagrams.scenario import RobotParameters
from pfsc_drake.control.compliance.tuned_impedance import (
    load_inertia,
    load_inertia_ratio,
    tolerable_inertia_ratio,
)

PERIOD = 1e-3


def grows(share, ticks, bandwidth=np.inf):
    """Whether ``m y'' = f - M_L y''`` grows, whose acceleration comes ticks later, after a lag."""
    a = 1.0 if np.isinf(bandwidth) else 1.0 - np.exp(-bandwidth * PERIOD)
    # commanded acceleration u[k] = -share y''[k - ticks], y''[k] = (1 - a) y''[k - 1] + a u[k]
    polynomial = np.zeros(ticks + 2)
    polynomial[0], polynomial[1] = 1.0, -(1.0 - a)
    polynomial[ticks] += a * share
    return bool(np.abs(np.roots(polynomial)).max() > 1.0)


@pytest.mark.parametrize("ticks", [1, 3])
def test_torques_bear_as_much_as_the_virtual_mass(ticks):
    assert tolerable_inertia_ratio(ticks * PERIOD) == 1.0
    assert not grows(0.99, ticks)
    assert grows(1.01, ticks)


@pytest.mark.parametrize(("bandwidth", "ticks"), [(300.0, 5), (120.0, 4), (60.0, 8)])
def test_the_lag_of_servos_lets_more_be_borne(bandwidth, ticks):
    """The sampled lag is half a tick later than the lag itself."""
    share = tolerable_inertia_ratio((ticks - 0.5) * PERIOD, bandwidth)
    assert share > 1.5
    assert not grows(0.97 * share, ticks, bandwidth)
    assert grows(1.03 * share, ticks, bandwidth)


def test_it_is_the_share_of_the_load_in_the_arms_inertia():
    """Drake's mass matrix with all of the tool less that without."""
    arm = read_arm(RobotParameters("comau_racer_1_4", tool_frame="tool_point"), Path())
    plant, q = arm.plant, np.deg2rad([-5.0, 100.0, -35.0, 20.0, -70.0, 30.0])
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, q)
    before = plant.CalcMassMatrix(context)
    load = arm.tool_load("weld_tool")
    plant.GetBodyByName("tool").SetMass(context, 1e-9)
    load_inertia_matrix = before - plant.CalcMassMatrix(context)
    drake = arm.coordinates.link_rows[:6, :6]
    q_J = drake @ q
    np.testing.assert_allclose(
        load_inertia(arm.chain, load, q_J), drake @ load_inertia_matrix @ drake.T, atol=1e-7
    )
    J = 3.0 * np.diag([1.0, 2.0, 0.0, 0.0, 0.0, 0.0])
    share, worst = load_inertia_ratio(J, np.eye(6), np.array([3.0, 3.0, *[np.inf] * 4]))
    assert (share, worst) == (pytest.approx(2.0), 1)


def test_a_direction_between_two_coordinates_may_be_the_worst():
    """Both carry 2 kg of 4, and 1.5 kg go from one to the other: 3.5 kg of 4 along their sum."""
    inertia = np.array([[2.0, 1.5], [1.5, 2.0]])
    share, _ = load_inertia_ratio(inertia, np.eye(2), np.array([4.0, 4.0]))
    assert share == pytest.approx(3.5 / 4.0)
    assert load_inertia_ratio(inertia, np.eye(2), np.array([np.inf, np.inf]))[0] == 0.0
