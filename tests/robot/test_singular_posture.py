"""Singular postures: Jacobian and slopes against finite differences."""

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pfsc_drake.robot.robot_model import pose_function
from pfsc_drake.robot.singular_posture import singular_posture, task_jacobian, tool_jacobian

GENERIC = np.array([0.3, -0.4, 1.1, 0.5, 0.8, -0.7])


def differences(pose, q, h=1e-6):
    """Return the Jacobian by central differences of a pose function."""
    columns = []
    for step in h * np.eye(len(q)):
        after, before = (np.array(pose(x)).ravel() for x in (q + step, q - step))
        R_1, R_0 = after[3:].reshape(3, 3), before[3:].reshape(3, 3)
        turn = Rotation.from_matrix(R_1 @ R_0.T).as_rotvec()
        columns.append(np.concatenate([after[:3] - before[:3], turn]) / (2.0 * h))
    return np.array(columns).T


def test_jacobian_of_the_tool(spherical_wrist):
    q = ca.SX.sym("q", 6)
    J = np.array(ca.Function("J", [q], [tool_jacobian(spherical_wrist, q)])(GENERIC))
    np.testing.assert_allclose(J, differences(pose_function(spherical_wrist), GENERIC), atol=1e-8)
    np.testing.assert_allclose(
        singular_posture(spherical_wrist, GENERIC, oriented=True).jacobian, J, atol=1e-15
    )


@pytest.mark.parametrize("oriented", [False, True])
def test_slopes_of_the_smallest_singular_value(shoulder_and_elbow, spherical_wrist, oriented):
    robot, q = (spherical_wrist, GENERIC) if oriented else (shoulder_and_elbow, GENERIC[:3])
    found = singular_posture(robot, q, oriented=oriented)
    pose = pose_function(robot)
    scale = np.array([1.0 / found.length] * 3 + [1.0] * 3)[: len(found.jacobian)]

    def singular_values(q):
        return np.linalg.svd(scale[:, None] * differences(pose, q)[: len(scale)])[1]

    h, s = 1e-4, singular_values(q)
    slopes = [
        (singular_values(q + step)[-1] - singular_values(q - step)[-1]) / (2.0 * h)
        for step in h * np.eye(len(q))
    ]
    np.testing.assert_allclose(found.cause, slopes, atol=1e-5)
    assert np.abs(slopes).max() > 0.1
    assert found.rcond == pytest.approx(s[-1] / s[0], rel=1e-6)
    assert found.length == pytest.approx(np.linalg.norm(found.jacobian[:3], axis=0).max())


AXIS = np.array([0.6, 0.0, 0.8])


def test_rows_of_an_axis(spherical_wrist):
    """They give the speed of the axis' tip, and nothing of turns about it."""
    q, pose = ca.SX.sym("q", 6), pose_function(spherical_wrist)
    expression = task_jacobian(spherical_wrist, q, oriented=True, tool_axis=AXIS)
    J = np.array(ca.Function("J", [q], [expression])(GENERIC))
    full, R_e = differences(pose, GENERIC), np.array(pose(GENERIC)).ravel()[3:].reshape(3, 3)
    assert J.shape == (5, 6)
    np.testing.assert_allclose(J[:3], full[:3], atol=1e-8)
    for rates, turn in zip(J[3:].T, full[3:].T, strict=True):
        tip = np.cross(turn, R_e @ AXIS)
        assert np.linalg.norm(rates) == pytest.approx(np.linalg.norm(tip), abs=1e-8)


@pytest.mark.parametrize("axis", [None, AXIS])
def test_slopes_with_more_joints_than_the_tool_needs(make_chain, spherical_wrist, axis):
    robot, q = spherical_wrist, GENERIC
    found = singular_posture(robot, q, oriented=axis is not None, tool_axis=axis)
    assert found.is_redundant
    symbol = ca.SX.sym("q", 6)
    J = task_jacobian(robot, symbol, oriented=axis is not None, tool_axis=axis)
    scale = np.ones(J.shape[0])
    scale[:3] = 1.0 / found.length
    function = ca.Function("J", [symbol], [J])

    def least(q):
        return np.linalg.svd(scale[:, None] * np.array(function(q)))[1][-1]

    h = 1e-5
    slopes = [(least(q + step) - least(q - step)) / (2.0 * h) for step in h * np.eye(6)]
    np.testing.assert_allclose(found.cause, slopes, atol=1e-7)
    # the motion is that of the singular value, not one that never moves the tool
    moved = np.linalg.norm(scale * (found.jacobian @ found.free))
    assert moved == pytest.approx(least(q), rel=1e-9)
