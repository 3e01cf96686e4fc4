"""Start poses of robots whose kinematics are plain to see."""

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.robot.inverse_kinematics import ToolTarget, solve_pose
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.links import ChainLink


def link(kind, axis, lower, upper):
    return ChainLink(
        name=kind,
        kind=kind,
        R_PF=np.eye(3),
        p_PF=np.zeros(3),
        axis=np.array(axis, dtype=float),
        mass=1.0,
        p_LC=np.zeros(3),
        I_C=np.eye(3),
        position_limits=(lower, upper),
    )


@pytest.fixture(name="cylinder")
def fixture_cylinder():
    """A robot whose joints are cylinder coordinates: angle, height, radius."""
    turn = link("revolute", (0, 0, 1), -2.9, 2.9)
    lift, reach = link("prismatic", (0, 0, 1), -1, 1), link("prismatic", (1, 0, 0), 0.1, 1)
    return SerialChain((turn, lift, reach))


def at(angle, height, radius):
    return np.array([radius * np.cos(angle), radius * np.sin(angle), height])


@pytest.mark.parametrize("guess", [2.5, -2.8, -2.5])
def test_a_pose_across_the_stop(cylinder, guess):
    """From -2.8 rad the nearest way to 2.7 rad leads against the stop at -2.9 rad."""
    q = solve_pose(cylinder, ToolTarget(at(2.7, 0.3, 0.5)), np.array([guess, 0.0, 0.5]), "start")
    np.testing.assert_allclose(q, [2.7, 0.3, 0.5], atol=1e-8)


@pytest.mark.parametrize("target", [at(3.0, 0.3, 0.5), at(0.0, 1.2, 0.5), at(1.0, 0.0, 1.1)])
def test_poses_beyond_the_limits(cylinder, target):
    with pytest.raises(InputError, match=r"start: position .* unreachable within the joint limits"):
        solve_pose(cylinder, ToolTarget(target), np.array([0.5, 0.0, 0.5]), "start")


@pytest.mark.parametrize("limit", [np.inf, 1e16, 1e150])
def test_joints_without_limits(limit):
    turn = link("revolute", (0, 0, 1), -0.5, limit)
    lift, reach = link("prismatic", (0, 0, 1), -limit, 3), link("prismatic", (1, 0, 0), 0.1, limit)
    robot = SerialChain((turn, lift, reach))
    q = solve_pose(robot, ToolTarget(at(2.7, -7.0, 20.0)), np.array([2.0, 0.0, 1.0]), "start")
    np.testing.assert_allclose(q, [2.7, -7.0, 20.0], atol=1e-7)
