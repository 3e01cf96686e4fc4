"""Names of singular postures, on small arms of our own."""

import dataclasses

import numpy as np
import pytest

from pfsc_drake.robot.robot_model import pose_function
from pfsc_drake.robot.singular_posture import joint_axes, singular_posture, singularity_name

X, Y, Z = np.eye(3)
UPPER_ARM, FOREARM = 0.7, 0.6  # m, of the arms in conftest.py
GENERIC = np.array([0.3, -0.4, 1.1, 0.5, 0.8, -0.7])


def test_axes_carry_the_jacobian(spherical_wrist):
    """A revolute joint turns the tool about its axis."""
    points, directions, y = joint_axes(spherical_wrist, GENERIC)
    y_t = np.array(pose_function(spherical_wrist)(GENERIC)).ravel()[:3]
    np.testing.assert_allclose(y, y_t, atol=1e-14)
    J = np.vstack([np.cross(directions, y - points).T, directions.T])
    expected = singular_posture(spherical_wrist, GENERIC, oriented=True).jacobian
    np.testing.assert_allclose(J, expected, atol=1e-14)


def test_axes_behind_a_slide(make_chain):
    robot = make_chain([(Z, [0, 0, 0.1]), (X, [0.2, 0, 0]), (Y, [0, 0.3, 0])], [0, 0, 0.5], [1])
    q = np.array([np.pi / 2.0, 0.4, np.pi / 2.0])
    points, directions, y = joint_axes(robot, q)
    # the base turns x to y; the slide goes along y; the last joint turns z to the slide's axis
    np.testing.assert_allclose(points, [[0, 0, 0.1], [0, 0.2, 0.1], [-0.3, 0.6, 0.1]], atol=1e-15)
    np.testing.assert_allclose(directions, [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], atol=1e-15)
    np.testing.assert_allclose(y, [-0.3, 1.1, 0.1], atol=1e-15)


@pytest.mark.parametrize("oriented", [False, True])
def test_a_stretched_elbow(shoulder_and_elbow, spherical_wrist, oriented):
    robot, q = (
        (spherical_wrist, GENERIC.copy()) if oriented else (shoulder_and_elbow, GENERIC[:3].copy())
    )
    q[2] = 1e-4
    found = singular_posture(robot, q, oriented=oriented)
    assert found.rcond < 1e-4
    assert found.causing_joints == [2]
    # the wrist's centre stays while upper arm and forearm turn at the ratio of their levers
    ratio = found.free[1] / found.free[2]
    assert ratio == pytest.approx(-FOREARM / (UPPER_ARM + FOREARM), rel=1e-3)
    assert singularity_name(robot, q, found) == "elbow"


def test_a_wrist_in_line(spherical_wrist):
    q = np.where(np.arange(6) == 4, 2e-4, GENERIC)
    found = singular_posture(spherical_wrist, q, oriented=True)
    assert found.rcond < 2e-4
    assert (found.free_joints, found.causing_joints) == ([3, 5], [4])
    assert found.free[3] == pytest.approx(-found.free[5], rel=1e-3)
    assert singularity_name(spherical_wrist, q, found) == "wrist"


@pytest.mark.parametrize("oriented", [False, True])
def test_a_wrist_above_the_first_axis(shoulder_and_elbow, spherical_wrist, oriented):
    """The shoulder is singular where the reach ``0.7 cos q_2 + 0.6 cos(q_2 + q_3)`` is zero."""
    robot, q = (
        (spherical_wrist, GENERIC.copy()) if oriented else (shoulder_and_elbow, GENERIC[:3].copy())
    )
    q[2] = np.arccos(-UPPER_ARM / FOREARM * np.cos(-1.2)) + 1.2
    q[1] = -1.2
    found = singular_posture(robot, q, oriented=oriented)
    assert found.rcond < 1e-12
    assert 0 in found.free_joints
    assert set(found.causing_joints) <= {1, 2}
    assert singularity_name(robot, q, found) == "shoulder"


def test_no_names_where_they_do_not_fit(make_chain, offset_wrist):
    scara = make_chain([(Z, [0, 0, 0.4]), (Z, [0.3, 0, 0]), (Y, [0.3, 0, 0])], [0.1, 0, 0])
    q = np.array([0.4, 1e-4, 0.8])
    found = singular_posture(scara, q, oriented=False)
    assert found.causing_joints == [1]
    assert singularity_name(scara, q, found) is None
    gantry = make_chain([(X, [0, 0, 0]), (Y, [0, 0, 0]), (Y, [0, 0, 0])], [0, 0, 0.1], [0, 1])
    q = np.array([0.4, 0.3, 1e-4 + np.pi / 2.0])
    assert singularity_name(gantry, q, singular_posture(gantry, q, oriented=False)) is None
    q = np.where(np.arange(6) == 4, 2e-4, GENERIC)
    found = singular_posture(offset_wrist, q, oriented=True)
    assert singularity_name(offset_wrist, q, found) is None


def test_names_with_an_axis_to_follow(spherical_wrist):
    """The last joint turns the tool about its axis; in line with it, the fourth does as well."""
    q = np.where(np.arange(6) == 4, 2e-4, GENERIC)
    robot = dataclasses.replace(spherical_wrist, p_LT=np.array([0.2, 0.0, 0.0]))
    found = singular_posture(robot, q, oriented=True, tool_axis=X)
    assert found.rcond < 2e-4
    assert (found.free_joints, found.causing_joints) == ([3], [4])
    assert singularity_name(robot, q, found) == "wrist"
    q = np.where(np.arange(6) == 2, 1e-4, GENERIC)
    # more joints than needed get by without the elbow
    assert singular_posture(robot, q, oriented=False).rcond > 1e-2
    assert singularity_name(robot, q, singular_posture(robot, q, oriented=False)) is None
