"""Start poses of robots whose kinematics are plain to see."""

import numpy as np
import pytest
from scipy.linalg import null_space

from pfsc_drake.errors import InputError
from pfsc_drake.robot.inverse_kinematics import ToolTarget, solve_pose
from pfsc_drake.robot.robot_model import pose_function
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


X, Y, Z = np.eye(3)
# a shoulder, an elbow, a forearm and a wrist; five of them, six and seven
JOINTS = [(Z, [0, 0, 0.4]), (Y, [0, 0, 0]), (Y, [0.6, 0, 0]), (X, [0.1, 0, 0]), (Y, [0.5, 0, 0]),
          (X, [0, 0, 0]), (Z, [0.1, 0.05, 0])]  # fmt: skip
TOOL, AXIS = [0.15, 0.02, 0.1], np.array([0.6, 0.0, 0.8])
POSTURE = np.array([0.3, -0.9, 1.4, 0.4, 0.8, -0.5, 0.2])


@pytest.mark.parametrize("num_joints", [5, 6, 7])
@pytest.mark.parametrize("outputs", ["position", "axis", "pose"])
def test_redundant_robots_stay_near_the_guess(make_chain, num_joints, outputs):
    if (num_joints, outputs) == (5, "pose"):
        return
    robot = make_chain(JOINTS[:num_joints], TOOL)
    pose = pose_function(robot)
    rng = np.random.default_rng(num_joints)
    there = np.array(pose(POSTURE[:num_joints])).ravel()
    y_t, R_e = there[:3], there[3:].reshape(3, 3)
    target = {
        "position": ToolTarget(y_t),
        "axis": ToolTarget(y_t, R_e, AXIS),
        "pose": ToolTarget(y_t, R_e),
    }[outputs]
    guess = POSTURE[:num_joints] + rng.uniform(-0.25, 0.25, num_joints)
    q = solve_pose(robot, target, guess, "start")
    found = np.array(pose(q)).ravel()
    np.testing.assert_allclose(found[:3], y_t, rtol=0, atol=1e-9)
    slopes = np.array(pose.factory("jacobian", ["q"], ["jac:pose:q"])(q))
    if outputs == "axis":
        np.testing.assert_allclose(found[3:].reshape(3, 3) @ AXIS, R_e @ AXIS, rtol=0, atol=1e-9)
        slopes = np.vstack([slopes[:3], np.kron(np.eye(3), AXIS) @ slopes[3:]])
    elif outputs == "pose":
        np.testing.assert_allclose(found, there, rtol=0, atol=1e-9)
    else:
        slopes = slopes[:3]
    # no motion that keeps the tool leads nearer
    free = null_space(slopes, rcond=1e-9)
    assert free.shape[1] == num_joints - target.num_outputs
    np.testing.assert_allclose(free.T @ (q - guess), 0.0, atol=1e-3)
    assert np.linalg.norm(q - guess) < 1.0


def test_the_tool_may_turn_about_its_axis_at_the_start(make_chain):
    """The guess's own turn about the last joint is kept, whatever the path's orientation has."""
    robot = make_chain([*JOINTS[:5], (X, [0, 0, 0])], [0.2, 0.0, 0.0])
    pose, q_0 = pose_function(robot), POSTURE[:6]
    there = np.array(pose(q_0 + 2.0 * np.eye(6)[5])).ravel()
    target = ToolTarget(there[:3], there[3:].reshape(3, 3), X)
    np.testing.assert_allclose(solve_pose(robot, target, q_0, "start"), q_0, rtol=0, atol=1e-8)
