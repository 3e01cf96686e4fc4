"""Laws for stiff joints on soft ones, against frequency responses of motors and links."""

import numpy as np
import pytest

from pfsc_drake.control.law.soft_joints import SoftJoints, bending, composite_law_error

POLES = (20.0, 25.0)


def arm(n, stiffness, seed=3):
    """Return joints of a made-up arm of n axes; the first mass matrix is far from diagonal."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(n, n))
    D_E = root @ root.T + 0.5 * np.eye(n)
    J = np.eye(n) + 0.3 * rng.normal(size=(n, n))
    return SoftJoints(D_E, rng.uniform(0.5, 2.0, n), stiffness * rng.uniform(0.5, 2.0, n), J)


def gains(n):
    return np.array([[POLES[0] * POLES[1]] * n, [sum(POLES)] * n])


def controlled(joints, damping, proportional):
    """Return A, B of ``x' = A x + B v_p`` with ``x = [q_J, q_M, v_J, v_M]`` under the law.

    ``v_p = y_p'' + a_2 y_p' + a_1 y_p`` is what the reference contributes.
    """
    n, K = len(joints.K_s), np.diag(joints.K_s)
    D_M, eps = np.diag(joints.D_M), np.diag(damping)
    to_torque = (joints.D_E + D_M) @ np.linalg.inv(joints.J)
    # tau_d = to_torque (v_p - a_2 J v_J - a_1 J q_J) - eps K (v_M - v_J)
    position, rate = (to_torque @ np.diag(a) @ joints.J for a in proportional)
    zero, one = np.zeros((n, n)), np.eye(n)
    link = np.linalg.solve(joints.D_E, np.hstack([-K, K, zero, zero]))
    drive = np.hstack([K - position, -K, eps @ K - rate, -eps @ K])
    A = np.vstack(
        [
            np.hstack([zero, zero, one, zero]),
            np.hstack([zero, zero, zero, one]),
            link,
            np.linalg.solve(D_M, drive),
        ]
    )
    return A, np.vstack([np.zeros((3 * n, n)), np.linalg.solve(D_M, to_torque)])


def worst_error(joints, damping, proportional):
    """Return the largest error of the tool point per acceleration, from states and inputs."""
    A, B = controlled(joints, damping, proportional)
    n, errors = len(joints.K_s), []
    for omega in np.geomspace(0.3, 3e3, 1000):
        s = 1j * omega
        a_1, a_2 = proportional
        wanted = np.diag(1.0 + a_2 / s + a_1 / s**2)
        x = np.linalg.solve(s * np.eye(4 * n) - A, B @ wanted)
        errors.append(np.linalg.norm((joints.J @ x[:n] - np.eye(n) / s**2)[:3, :3], 2))
    return max(errors)


@pytest.mark.slow(but=["10000.0-6", "100000.0-3"])
@pytest.mark.parametrize("n", [3, 6])
@pytest.mark.parametrize("stiffness", [1e4, 1e5])
def test_the_composite_law(n, stiffness):
    joints = arm(n, stiffness)
    damping = np.linspace(0.5, 1.0, n) * joints.D_M / joints.K_s * 300.0
    error = composite_law_error(joints, damping, gains(n))
    assert np.max(np.linalg.eigvals(controlled(joints, damping, gains(n))[0]).real) < 0.0
    assert error == pytest.approx(worst_error(joints, damping, gains(n)), rel=2e-3)


def test_stiff_joints_follow_and_soft_ones_are_unstable():
    errors = []
    for stiffness in (1e7, 1e6, 1e5, 1e2):
        joints = arm(3, stiffness)
        damping = 2.0 * np.sqrt(joints.D_M / joints.K_s)
        errors.append(composite_law_error(joints, damping, gains(3)))
    # of stiff joints the lag is that of the damping, which goes with the root of the stiffness
    assert errors[1] / errors[0] == pytest.approx(np.sqrt(10.0), rel=0.1)
    assert errors == sorted(errors)
    assert np.max(np.linalg.eigvals(controlled(joints, damping, gains(3))[0]).real) > 0.0
    assert errors[-1] == np.inf


def test_without_damping_the_loop_is_unstable():
    joints = arm(3, 1e5)
    assert np.max(np.linalg.eigvals(controlled(joints, np.zeros(3), gains(3))[0]).real) > 0.0
    assert composite_law_error(joints, np.zeros(3), gains(3)) == np.inf


def test_bending_of_one_joint():
    """An arm of length 0.5 m: ``K_s delta = D_E y'' / 0.5``, ``y = 0.5 delta``."""
    one = SoftJoints(np.array([[4.0]]), np.ones(1), np.array([800.0]), np.array([[0.5]]))
    assert bending(one) == pytest.approx(4.0 / 800.0)


@pytest.mark.parametrize("n", [3, 6])
def test_bending_under_the_worst_acceleration(n):
    """Torques that accelerate the tool in many directions, without turning it."""
    joints, rng = arm(n, 1e4), np.random.default_rng(1)
    y_dd = np.zeros((n, 5000))
    y_dd[:3] = rng.normal(size=(3, 5000))
    y_dd /= np.linalg.norm(y_dd, axis=0)
    torque = joints.D_E @ np.linalg.solve(joints.J, y_dd)
    moved = np.linalg.norm((joints.J @ (torque / joints.K_s[:, None]))[:3], axis=0)
    assert moved.max() <= bending(joints) * (1.0 + 1e-12)
    assert moved.max() == pytest.approx(bending(joints), rel=1e-2)


@pytest.mark.parametrize("stiffness", [1e4, 1e5])
def test_a_joint_that_the_tool_does_not_need(stiffness):
    """It has no part in the error, and is held by gains of its own."""
    needed, one = arm(3, stiffness), np.ones(1)
    more = SoftJoints(
        np.block([[needed.D_E, np.zeros((3, 1))], [np.zeros((1, 3)), 2.0]]),
        np.append(needed.D_M, one),
        np.append(needed.K_s, stiffness),
        np.hstack([needed.J, np.zeros((3, 1))]),
    )
    damping = 300.0 * needed.D_M / needed.K_s
    expected = composite_law_error(needed, damping, gains(3))
    damping = np.append(damping, 300.0 / stiffness)
    assert composite_law_error(more, damping, gains(3)) == np.inf
    found = composite_law_error(more, damping, gains(3), gains(4))
    assert 0.0 < expected < np.inf
    assert found == pytest.approx(expected, rel=1e-3)
    assert bending(more) == pytest.approx(bending(needed), rel=1e-12)
