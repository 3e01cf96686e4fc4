"""The DH transformations against products of elementary ones."""

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.robot.serial.denavit_hartenberg import DenavitHartenberg, dh_transform


def rotation_z(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])


def rotation_x(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1.0]])


def translation(x: float, z: float) -> np.ndarray:
    H = np.eye(4)
    H[:3, 3] = [x, 0.0, z]
    return H


def test_transform_is_the_product_of_its_four_parts():
    theta, d, a, alpha = 0.7, 0.3, -0.2, 1.1
    expected = rotation_z(theta) @ translation(0, d) @ translation(a, 0) @ rotation_x(alpha)
    np.testing.assert_allclose(dh_transform(theta, d, a, alpha), expected, atol=1e-15)


def test_planar_arm_has_the_textbook_pose():
    table = DenavitHartenberg(d=[0, 0], a=[0.5, 0.25], alpha=[0, 0])
    q = np.array([0.4, -1.1])
    y_t, R_e = table.pose(q, tool_offset=[0.1, 0.0, 0.2])
    x = 0.5 * np.cos(q[0]) + 0.35 * np.cos(q.sum())
    y = 0.5 * np.sin(q[0]) + 0.35 * np.sin(q.sum())
    np.testing.assert_allclose(y_t, [x, y, 0.2], atol=1e-15)
    np.testing.assert_allclose(R_e, rotation_z(q.sum())[:3, :3], atol=1e-15)


def test_link_poses_start_at_the_base_and_end_at_the_pose():
    table = DenavitHartenberg(d=[0.1, 0.2], a=[0.5, 0.25], alpha=[0.3, -0.4])
    poses = table.link_poses([0.2, 0.3])
    np.testing.assert_array_equal(poses[0], np.eye(4))
    np.testing.assert_allclose(poses[1], dh_transform(0.2, 0.1, 0.5, 0.3), atol=1e-15)
    np.testing.assert_allclose(poses[2][:3, 3], table.pose([0.2, 0.3])[0], atol=1e-15)


def test_table_cannot_be_changed():
    table = DenavitHartenberg(d=[0.1], a=[0.5], alpha=[0.3])
    with pytest.raises(ValueError, match="read-only"):
        table.d[0] = 1.0


@pytest.mark.parametrize("q", [[0.0], [0.0, np.nan], [[0.0, 0.0]]])
def test_refuses_wrong_joint_angles(q):
    table = DenavitHartenberg(d=[0, 0], a=[0.5, 0.25], alpha=[0, 0])
    with pytest.raises(InputError, match="must be 2 finite numbers"):
        table.pose(q)


def test_refuses_columns_of_different_length():
    with pytest.raises(InputError, match="'alpha': 1"):
        DenavitHartenberg(d=[0, 0], a=[0.5, 0.25], alpha=[0])
