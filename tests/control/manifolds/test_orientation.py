"""Angles of a tool's axis: small errors, free turns, and their derivatives."""

import casadi as ca
import numpy as np
import pytest
from numpy.polynomial import Chebyshev
from scipy.spatial.transform import Rotation

from pfsc_drake.control.manifolds.orientation import (
    ToolOrientation,
    orientation_error,
    quaternion_rotation,
    yaw_error,
)
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import rotation_to_axis, turn_about
from pfsc_drake.jets import Jet

AXES = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.3, -0.5, 0.2]]
ORDER, HALF_WINDOW = 4, 0.06
# rad/s; two turns in the window
SPIN = 100.0


def value(R_e, q_d, C):
    """Return the angles at one instant; q_d is (w, x, y, z)."""
    angles = orientation_error(Jet([ca.SX(R_e)]), quaternion_rotation(Jet([ca.SX(q_d)])), C)
    return np.array([float(ca.evalf(angle.coefficients[0])) for angle in angles])


@pytest.mark.parametrize("axis", AXES)
def test_small_errors_are_turns_across_the_axis(axis):
    """To first order; the axis itself turns by ``delta x axis`` in the path's tool frame."""
    rng, C = np.random.default_rng(1), rotation_to_axis(axis)
    R_d, delta = Rotation.random(random_state=2), 1e-5 * rng.uniform(-1.0, 1.0, 3)
    found = value((R_d * Rotation.from_rotvec(delta)).as_matrix(), np.roll(R_d.as_quat(), 1), C)
    np.testing.assert_allclose(found, [C[:, 2] @ delta, C[:, 1] @ delta], rtol=0, atol=1e-10)
    moved = np.cross(delta, C[:, 0])
    np.testing.assert_allclose(found, [C[:, 1] @ moved, -C[:, 2] @ moved], rtol=0, atol=1e-10)


def test_the_axis_z_turns_about_x_and_y():
    found = value(Rotation.from_rotvec([1e-5, 2e-5, 3.0e-5]).as_matrix(), [1, 0, 0, 0],
                  rotation_to_axis([0, 0, 1]))  # fmt: skip
    np.testing.assert_allclose(found, [-1e-5, 2e-5], rtol=0, atol=1e-9)


@pytest.mark.parametrize("axis", AXES)
def test_turns_about_the_axis_change_nothing(axis):
    C = rotation_to_axis(axis)
    R_d, R_e = Rotation.random(2, random_state=4)
    expected = value(R_e.as_matrix(), np.roll(R_d.as_quat(), 1), C)
    assert np.abs(expected).max() > 0.3
    for turn in np.linspace(-20.0, 20.0, 9):
        turned = R_e * Rotation.from_rotvec(turn * C[:, 0])
        found = value(turned.as_matrix(), np.roll(R_d.as_quat(), 1), C)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)


@pytest.mark.parametrize("axis", AXES)
def test_jets_while_the_tool_turns_round_and_round(axis):
    """Against polynomials through samples of the direction of the axis."""
    rng, C = np.random.default_rng(6), rotation_to_axis(axis)
    vectors = rng.uniform(-0.5, 0.5, (2, 3, ORDER + 1))
    t = ca.SX.sym("t")
    powers = ca.vertcat(*[t**k for k in range(ORDER + 1)])
    # of any norm: the path's orientation; the tool's, which spins about the axis
    q_d, q_e = (ca.vertcat(1.5, ca.DM(v) @ powers) for v in vectors)
    spin = ca.vertcat(ca.cos(0.5 * SPIN * t), ca.sin(0.5 * SPIN * t) * ca.DM(C[:, 0]))
    signals = ca.vertcat(q_d, ca.vec(rotation(q_e) @ rotation(spin)))
    sampled, derivatives = ca.Function("signals", [t], [signals]), []
    for _ in range(ORDER + 1):
        derivatives.append(ca.SX(ca.Function("d", [t], [signals])(0.0)))
        signals = ca.jacobian(signals, t)
    angles = orientation_error(
        Jet.from_derivatives([ca.reshape(d[4:], 3, 3) for d in derivatives]),
        quaternion_rotation(Jet.from_derivatives([d[:4] for d in derivatives])),
        C,
    )
    degree = 14
    times = HALF_WINDOW * np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
    samples = []
    for time in times:
        x = np.array(sampled(time)).ravel()
        R_d = Rotation.from_quat(np.roll(x[:4], -1)).as_matrix()
        direction = C.T @ R_d.T @ x[4:].reshape(3, 3, order="F") @ C[:, 0]
        samples.append([np.arctan2(direction[1], direction[0]), -np.arcsin(direction[2])])
    for angle, column in zip(angles, np.array(samples).T, strict=True):
        fit = Chebyshev.fit(times, column, degree, domain=[-HALF_WINDOW, HALF_WINDOW])
        for k, tolerance in enumerate([1e-12, 1e-10, 1e-8, 1e-6, 1e-4]):
            expected = fit.deriv(k)(0.0) if k else fit(0.0)
            found = float(ca.evalf(angle.derivative(k)))
            assert abs(found - expected) < tolerance * (1.0 + abs(expected)), k


def rotation(q):
    """Return the rotation of a quaternion (w, x, y, z) of any norm as an expression."""
    w, v = q[0], q[1:]
    R = (w**2 - ca.dot(v, v)) * ca.SX.eye(3) + 2.0 * v @ v.T + 2.0 * w * ca.skew(v)
    return R / ca.dot(q, q)


@pytest.mark.parametrize("axis", AXES)
def test_coordinates_of_an_axis(axis):
    manifold = PathManifold(3, oriented=True, tool_axis=7.0 * np.array(axis))
    assert [c.name for c in manifold.coordinates] == ["eta", "xi_1", "xi_2", "phi_z", "phi_y"]
    assert [c.force for c in manifold.coordinates[3:]] == ["tau_z", "tau_y"]
    np.testing.assert_allclose(manifold.tool.tool_axis, axis / np.linalg.norm(axis), atol=1e-15)
    assert PathManifold(3, oriented=True).tool.tool_axis is None


@pytest.mark.parametrize("axis", AXES)
def test_a_turn_about_an_axis_in_space_whatever_the_tools_tilt(axis):
    """A tilt that comes first, about directions across the axis, has no part in it."""
    a, rng = np.array(axis) / np.linalg.norm(axis), np.random.default_rng(3)
    for turn in (-2.5, -0.4, 0.0, 1e-6, 1.0, 3.0):
        R_d = Rotation.random(random_state=rng)
        tilt = np.cross(a, rng.uniform(-1.5, 1.5, 3))
        R_e = Rotation.from_rotvec(turn * a) * Rotation.from_rotvec(tilt) * R_d
        q_d = 1.7 * np.roll(R_d.as_quat(), 1)
        found = yaw_error(
            Jet([ca.SX(R_e.as_matrix())]), quaternion_rotation(Jet([ca.SX(q_d)])), np.array(axis)
        )
        assert float(ca.evalf(found.coefficients[0])) == pytest.approx(turn, abs=1e-12)
        numbers = turn_about(axis, R_e.as_matrix()[None], R_d.as_matrix()[None])
        assert numbers == pytest.approx([turn], abs=1e-12)
    assert [c.name for c in ToolOrientation(yaw_axis=axis).coordinates] == ["phi"]


def test_one_axis_at_most():
    with pytest.raises(InputError, match=r"yaw axis \[0, 0, 1\]: the path has no orientation"):
        PathManifold(2, oriented=False, yaw_axis=[0, 0, 1])
    with pytest.raises(InputError, match="one of them at most"):
        PathManifold(2, oriented=True, tool_axis=[0, 0, 1], yaw_axis=[0, 0, 1])


def test_an_axis_needs_an_orientation_and_a_direction():
    with pytest.raises(InputError, match=r"tool axis \[0, 0, 1\]: the path has no orientation"):
        PathManifold(2, oriented=False, tool_axis=[0, 0, 1])
    with pytest.raises(InputError, match="not all zero"):
        PathManifold(2, oriented=True, tool_axis=np.zeros(3))
