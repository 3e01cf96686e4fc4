"""Orientation curves: keyframes, signs, revolutions."""

import math

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    FourierCurve,
    OrientationCurve,
    PiecewisePolynomialCurve,
    interpolate_orientation,
    quaternion_to_matrix,
    zyx_to_matrix,
    zyx_to_quaternion,
)


def _about_z(angle: np.ndarray) -> np.ndarray:
    zero = 0.0 * np.asarray(angle)
    return np.stack([np.cos(angle / 2), zero, zero, np.sin(angle / 2)], axis=-1)


@pytest.mark.parametrize("smoothness", [2, 3, 5])
def test_passes_through_keyframes_whatever_their_signs(smoothness: int) -> None:
    rng = np.random.default_rng(5)
    angles = np.add(np.cumsum(0.3 * rng.normal(size=(12, 3)), axis=0), (0.0, math.pi / 2, 0.0))
    q = zyx_to_quaternion(angles) * rng.choice([-2.0, 1.0], size=(12, 1))
    theta = np.cumsum(rng.uniform(0.5, 1.0, 12))
    curve = interpolate_orientation(q, theta, smoothness=smoothness)
    np.testing.assert_allclose(curve.rotation_matrix(theta), zyx_to_matrix(angles), atol=1e-10)
    assert curve.smoothness == smoothness
    assert curve.domain == (theta[0], theta[-1])
    assert curve.first_discontinuity(smoothness + 1) is not None


def test_steady_rotation_passes_every_representation_singularity() -> None:
    # About y through 90 degrees (singular for ZYX), in even steps: a spline of it is accurate.
    theta = np.linspace(0.0, 3.0, 31)
    q = np.stack([np.cos(theta / 2), 0 * theta, np.sin(theta / 2), 0 * theta], axis=1)
    curve = interpolate_orientation(q, theta, smoothness=4)
    fine = np.linspace(0.0, 3.0, 200)
    expected = zyx_to_matrix(np.stack([0 * fine, fine, 0 * fine], axis=1))
    np.testing.assert_allclose(curve.rotation_matrix(fine), expected, atol=1e-8)


@pytest.mark.parametrize("smoothness", [2, 3, 5])
def test_full_turn_takes_two_revolutions(smoothness: int) -> None:
    count = 16
    angle = 2 * np.pi * np.arange(count + 1) / count
    q = _about_z(angle)
    curve = interpolate_orientation(q, angle, smoothness=smoothness, closed=True)
    assert curve.closed
    assert curve.period == pytest.approx(4 * np.pi)
    assert curve.smoothness == smoothness
    theta = np.linspace(0.0, 2 * np.pi, 41)
    one = curve.derivatives(theta, smoothness)
    two = curve.derivatives(theta + 2 * np.pi, smoothness)
    scale = np.abs(one).max(axis=(0, 2), keepdims=True)
    np.testing.assert_allclose(one / scale, -two / scale, atol=1e-9)
    np.testing.assert_allclose(
        curve.rotation_matrix(theta), quaternion_to_matrix(_about_z(theta)), atol=2e-4
    )
    before, after = curve.derivatives([-0.3, 2 * np.pi - 0.3], 1)
    np.testing.assert_allclose(before, -after, atol=1e-10)


def test_closed_without_turn_takes_one_revolution() -> None:
    angle = 0.5 * np.sin(2 * np.pi * np.arange(10) / 10)
    curve = interpolate_orientation(_about_z(angle), np.arange(11.0), smoothness=3, closed=True)
    assert curve.period == pytest.approx(10.0)
    np.testing.assert_allclose(curve.rotation_matrix(10.0), curve.rotation_matrix(0.0), atol=1e-12)
    np.testing.assert_allclose(
        curve.derivatives(9.999999, 2), curve.derivatives(-1e-6, 2), atol=1e-9
    )


def test_one_keyframe_is_constant() -> None:
    curve = interpolate_orientation([[2.0, 0, 0, 0]], [0.0, 5.0], smoothness=5)
    assert curve.constant
    assert curve.smoothness == math.inf
    np.testing.assert_array_equal(curve.rotation_matrix([0.0, 7.0]), np.stack([np.eye(3)] * 2))
    np.testing.assert_array_equal(curve.derivatives(-3.0, 2), [[1, 0, 0, 0], [0] * 4, [0] * 4])


def test_two_keyframes_are_joined_smoothly() -> None:
    curve = interpolate_orientation(_about_z(np.array([0.0, 2.0])), [0.0, 1.0], smoothness=5)
    assert curve.smoothness == math.inf
    np.testing.assert_allclose(
        curve.rotation_matrix(0.5), quaternion_to_matrix(_about_z(np.array(1.0))), atol=1e-12
    )


def test_errors() -> None:
    with pytest.raises(InputError, match=r"orientations 2 and 3 are 175\.0 deg apart"):
        interpolate_orientation(
            _about_z(np.radians([0.0, 10.0, 185.0, 190.0])), np.arange(4.0), smoothness=2
        )
    with pytest.raises(InputError, match="must be the same rotation"):
        interpolate_orientation(
            _about_z(np.array([0.0, 1.0, 2.0, 3.0])), np.arange(4.0), smoothness=2, closed=True
        )
    with pytest.raises(InputError, match="2 distinct keyframes"):
        interpolate_orientation(
            _about_z(np.array([0.0, 1.0, 0.0])), np.arange(3.0), smoothness=2, closed=True
        )
    with pytest.raises(InputError, match="quaternion 2: "):
        interpolate_orientation([[1, 0, 0, 0], [0, 0, 0, 0]], [0, 1], smoothness=2)
    with pytest.raises(InputError, match="shape"):
        interpolate_orientation([[1, 0, 0]], [0, 1], smoothness=2)
    with pytest.raises(InputError, match=r"\|q\| = 0 at theta = 0\.5"):
        OrientationCurve(
            PiecewisePolynomialCurve(
                [0.0, 0.5, 1.0], [[[0.5, 0, 0, 0], [-1, 0, 0, 0]], [[0] * 4, [-1, 0, 0, 0]]]
            )
        )
    with pytest.raises(InputError, match="dimension 3; 4"):
        OrientationCurve(FourierCurve.bent_lemniscate())
