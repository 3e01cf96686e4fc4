"""Rotations against products of elementary rotations."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    angle_between,
    check_rotation_matrix,
    matrix_to_quaternion,
    matrix_to_zyx,
    matrix_to_zyz,
    quaternion_to_matrix,
    rotation_to_axis,
    zyx_to_matrix,
    zyx_to_quaternion,
    zyz_to_matrix,
    zyz_to_quaternion,
)

ANGLE = st.floats(-3.1, 3.1)


def _rx(a: float) -> np.ndarray:
    return np.array([[1, 0, 0], [0, math.cos(a), -math.sin(a)], [0, math.sin(a), math.cos(a)]])


def _ry(a: float) -> np.ndarray:
    return np.array([[math.cos(a), 0, math.sin(a)], [0, 1, 0], [-math.sin(a), 0, math.cos(a)]])


def _rz(a: float) -> np.ndarray:
    return np.array([[math.cos(a), -math.sin(a), 0], [math.sin(a), math.cos(a), 0], [0, 0, 1]])


@given(ANGLE, ANGLE, ANGLE)
def test_products_of_elementary_rotations(a: float, b: float, c: float) -> None:
    zyx, zyz = _rz(a) @ _ry(b) @ _rx(c), _rz(a) @ _ry(b) @ _rz(c)
    np.testing.assert_allclose(zyx_to_matrix([a, b, c]), zyx, atol=1e-14)
    np.testing.assert_allclose(zyz_to_matrix([a, b, c]), zyz, atol=1e-14)
    np.testing.assert_allclose(zyx_to_matrix(matrix_to_zyx(zyx)), zyx, atol=1e-11)
    np.testing.assert_allclose(zyz_to_matrix(matrix_to_zyz(zyz)), zyz, atol=1e-11)
    np.testing.assert_allclose(quaternion_to_matrix(matrix_to_quaternion(zyx)), zyx, atol=1e-14)


@given(ANGLE, st.floats(0.01, 1.5), ANGLE)
def test_angles_return(a: float, b: float, c: float) -> None:
    angles = [a, b, c]
    zyx, zyz = (quaternion_to_matrix(f(angles)) for f in (zyx_to_quaternion, zyz_to_quaternion))
    np.testing.assert_allclose(matrix_to_zyx(zyx), angles, atol=1e-10)
    np.testing.assert_allclose(matrix_to_zyz(zyz), angles, atol=1e-10)


@pytest.mark.parametrize("middle", [math.pi / 2, -math.pi / 2])
def test_zyx_singular(middle: float) -> None:
    R = _rz(0.4) @ _ry(middle) @ _rx(0.3)
    angles = matrix_to_zyx(R)
    assert angles[2] == 0.0
    np.testing.assert_allclose(zyx_to_matrix(angles), R, atol=1e-12)


@pytest.mark.parametrize("middle", [0.0, math.pi])
def test_zyz_singular(middle: float) -> None:
    R = _rz(0.4) @ _ry(middle) @ _rz(0.3)
    angles = matrix_to_zyz(R)
    assert angles[2] == 0.0
    np.testing.assert_allclose(zyz_to_matrix(angles), R, atol=1e-12)


def test_quaternion_convention_and_length() -> None:
    half = math.sqrt(0.5)
    np.testing.assert_allclose(matrix_to_quaternion(_rz(math.pi / 2)), [half, 0, 0, half])
    np.testing.assert_allclose(
        quaternion_to_matrix([-3.0, 0, 0, -3.0]), _rz(math.pi / 2), atol=1e-15
    )


def test_leading_axes() -> None:
    angles = np.random.default_rng(0).uniform(0.1, 1.0, (4, 5, 3))
    R = zyx_to_matrix(angles)
    assert R.shape == (4, 5, 3, 3)
    np.testing.assert_allclose(R[2, 3], zyx_to_matrix(angles[2, 3]))
    assert matrix_to_quaternion(R).shape == (4, 5, 4)
    np.testing.assert_allclose(matrix_to_zyx(R), angles, atol=1e-12)


def test_errors() -> None:
    with pytest.raises(InputError, match="R'R differs from the identity by 3"):
        check_rotation_matrix(2.0 * np.eye(3))
    with pytest.raises(InputError, match="flange: determinant -1; \\+1"):
        check_rotation_matrix(np.diag([1.0, 1.0, -1.0]), "flange")
    with pytest.raises(InputError, match="shape"):
        check_rotation_matrix(np.eye(4))
    with pytest.raises(InputError, match="finite"):
        check_rotation_matrix(np.full((3, 3), np.nan))
    with pytest.raises(InputError, match="not all zero"):
        quaternion_to_matrix([[1.0, 0, 0, 0], [0, 0, 0, 0]])
    with pytest.raises(InputError, match="not all zero"):
        quaternion_to_matrix([0.0, 0, 0, 0])
    with pytest.raises(InputError, match="shape"):
        quaternion_to_matrix([1.0, 0, 0])
    with pytest.raises(InputError, match="shape"):
        zyx_to_matrix([1.0, 2.0])
    with pytest.raises(InputError, match="finite"):
        zyz_to_matrix([1.0, np.inf, 0.0])


@given(st.lists(st.floats(-1e200, 1e200), min_size=3, max_size=3).filter(any))
def test_least_rotation_to_an_axis(axis):
    C = rotation_to_axis(axis)
    np.testing.assert_allclose(C.T @ C, np.eye(3), rtol=0, atol=1e-14)
    assert np.linalg.det(C) > 0.0
    direction = np.array(axis) / np.abs(axis).max()
    direction /= np.linalg.norm(direction)
    np.testing.assert_allclose(C[:, 0], direction, rtol=0, atol=1e-14)
    # the angle of the rotation is that between the axes, not more
    least = angle_between(np.array([1.0, 0.0, 0.0]), direction)
    angle = math.atan2(np.linalg.norm([C[2, 1] - C[1, 2], C[0, 2] - C[2, 0], C[1, 0] - C[0, 1]]),
                       np.trace(C) - 1.0)  # fmt: skip
    assert angle == pytest.approx(least, abs=1e-7)


def test_rotations_to_the_axes_of_the_frame():
    np.testing.assert_array_equal(rotation_to_axis([5.0, 0.0, 0.0]), np.eye(3))
    np.testing.assert_array_equal(rotation_to_axis([-1.0, 0.0, 0.0]), np.diag([-1.0, -1.0, 1.0]))
    np.testing.assert_array_equal(rotation_to_axis([0, 0, 1]), [[0, 0, -1], [0, 1, 0], [1, 0, 0]])


@pytest.mark.parametrize("axis", [[0.0, 0.0, 0.0], [1.0, 0.0], [1.0, math.nan, 0.0]])
def test_no_axis(axis):
    with pytest.raises(InputError, match="3 finite numbers, not all zero"):
        rotation_to_axis(axis)


def test_small_angles_between_directions():
    for angle in (1e-9, 0.3, 3.0, math.pi - 1e-9):
        turned = 7.0 * _rz(angle) @ [1.0, 0.0, 0.0]
        assert angle_between(np.array([1.0, 0.0, 0.0]), turned) == pytest.approx(angle, rel=1e-12)
