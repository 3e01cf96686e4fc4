"""Rotations as expressions, against scipy and finite differences."""

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pfsc_drake.blocks.rotations import (
    matrix_of,
    moment_of,
    nearest_turn,
    rotation_of,
    rotation_vector,
    rows_of,
)

SIZES = (0.0, 1e-9, 1e-4, 0.999e-3, 1.001e-3, 0.1, 1.0, 2.0, 3.0)


def numbers(expression):
    """Return what an expression without symbols is, a vector or a matrix."""
    return ca.evalf(ca.MX(expression)).full().squeeze()


def vectors(*sizes):
    random = np.random.default_rng(0)
    for size in sizes:
        axis = random.normal(size=3)
        yield size * axis / np.linalg.norm(axis)


def test_rotation_vectors_are_scipys():
    """Small rotations, any rotations, and nearly half a turn about all axes."""
    random = np.random.default_rng(0)
    R = ca.MX.sym("R", 3, 3)
    function = ca.Function("f", [R], [rotation_vector(R)])
    for size in (0.0, 1e-9, 1e-4, 1.9e-3, 2.1e-3, 0.1, 1.0, 2.0, 3.0, np.pi - 1e-6):
        axes = np.vstack([random.normal(size=(20, 3)), np.eye(3), -np.eye(3)])
        for axis in axes / np.linalg.norm(axes, axis=1)[:, None]:
            matrix = Rotation.from_rotvec(size * axis).as_matrix()
            found = function(matrix).full().ravel()
            np.testing.assert_allclose(found, size * axis, atol=1e-14, rtol=1e-9)


def test_rotations_of_vectors_are_scipys():
    for vector in vectors(*SIZES, 5.0):
        expected = Rotation.from_rotvec(vector).as_matrix()
        np.testing.assert_allclose(numbers(rotation_of(ca.DM(vector))), expected, atol=1e-14)


def test_a_moment_does_the_work_of_the_force_on_the_vector():
    """By differences of a rotation that turns on, at any angular velocity."""
    random, h = np.random.default_rng(1), 1e-5
    for vector in vectors(*SIZES[2:]):
        force, w = random.normal(size=(2, 3))
        ends = [
            (Rotation.from_rotvec(dt * w) * Rotation.from_rotvec(vector)).as_rotvec()
            for dt in (-h, h)
        ]
        rate = (ends[1] - ends[0]) / (2.0 * h)
        moment = numbers(moment_of(ca.DM(vector), ca.DM(force)))
        assert moment @ w == pytest.approx(force @ rate, abs=2e-8)


def test_a_turn_goes_on_beyond_pi():
    axis, turn = np.array([0.6, 0.0, -0.8]), np.zeros(3)
    for angle in np.linspace(0.0, 5.0, 40):
        R = Rotation.from_rotvec(angle * axis)
        turn = numbers(nearest_turn(ca.DM(R.as_rotvec()), ca.DM(turn)))
        np.testing.assert_allclose(turn, angle * axis, atol=1e-12)


def test_rows_are_those_of_the_matrix():
    R = Rotation.from_rotvec([0.3, -0.2, 0.9]).as_matrix()
    np.testing.assert_array_equal(numbers(rows_of(ca.DM(R))), R.ravel())
    np.testing.assert_array_equal(numbers(matrix_of(ca.DM(R.ravel()))), R)
