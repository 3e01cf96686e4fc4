"""Gains, feed-forward and what drives feel."""

import casadi as ca
import numpy as np
import pytest

from identification.measurement.servo import (
    Servo,
    drive_inertia,
    friction_torques,
    rigid_torques,
)
from identification.model.dynamic_parameters import true_parameters
from identification.model.regressor import Regressor
from identification.model.subject import load_subject
from pfsc_drake.errors import InputError
from pfsc_drake.robot.serial.rigid_rotors import rigid_mass_matrix


@pytest.fixture(scope="module", params=["comau_racer_1_4", "festo_expt_45"])
def subject(request):
    return load_subject(request.param)


def motion(subject, samples=30):
    lower, upper = subject.position_limits.T
    rng = np.random.default_rng(0)
    n = subject.dimension
    q = lower + (upper - lower) * rng.uniform(0.3, 0.7, (samples, n))
    return q, *rng.uniform(-1.0, 1.0, (2, samples, n))


def test_torques_of_the_true_parameters(subject):
    q, v, a = motion(subject)
    rho = true_parameters(subject)
    got = rigid_torques(subject, q, v, a) + friction_torques(v, subject.coulomb, subject.viscous)
    expected = Regressor(subject).matrix(q, v, a) @ rho
    np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-8)


def test_gains_assign_the_poles():
    """``J s^2 + K_d s + K_p`` with the stated bandwidth and damping."""
    K_p, K_d = Servo(bandwidth=100.0, damping=0.7).gains(np.array([2.0, 0.5]))
    for J, p, d in zip([2.0, 0.5], K_p, K_d, strict=True):
        poles = np.roots([J, d, p])
        np.testing.assert_allclose(np.abs(poles), 100.0)
        np.testing.assert_allclose(-poles.real / np.abs(poles), 0.7)


def test_a_drive_feels_least_when_all_others_are_free():
    comau = load_subject("comau_racer_1_4")
    q = motion(comau)[0]
    felt = drive_inertia(comau, q)
    x = ca.SX.sym("q", 6)
    D = ca.Function("D", [x], [rigid_mass_matrix(comau.chain, comau.mounts, x)])
    for posture in q:
        matrix = np.array(D(posture))
        for j in range(6):
            free = np.delete(np.arange(6), j)
            across = matrix[free, j]
            schur = matrix[j, j] - across @ np.linalg.solve(matrix[np.ix_(free, free)], across)
            assert felt[j] <= schur * (1.0 + 1e-9)
    assert np.all(felt > 0.3 * comau.chain.D_M)


def test_bad_servos():
    for name in ("bandwidth", "damping", "period"):
        with pytest.raises(InputError, match=f"{name} = -1"):
            Servo(**{name: -1.0})
    with pytest.raises(InputError, match=r"friction = -0\.1"):
        Servo(friction=-0.1)
    with pytest.raises(InputError, match=r"bandwidth = 400 .* at most 312\.5 rad/s"):
        Servo(bandwidth=400.0)
