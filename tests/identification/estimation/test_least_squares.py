"""Weighted least squares against ground truth, Drake's dynamics and chance."""

import time
from dataclasses import replace

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces
from scipy.stats import chi2

from identification.estimation.least_squares import NormalEquations, estimate
from identification.excitation.fourier import FourierTrajectory
from identification.measurement.periods import average
from identification.measurement.record import Record
from identification.model.base import base_parameters
from identification.model.dynamic_parameters import true_parameters
from identification.model.regressor import Regressor
from identification.model.subject import load_subject
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import resolve_model


def statistic(result, truth):
    error = result.base_parameters - truth
    return error @ np.linalg.solve(result.covariance, error)


def drake_torques(robot, subject, motion):
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(resolve_model(robot)))
    plant.Finalize()
    context, torques = plant.CreateDefaultContext(), []
    for q, v, a in zip(*motion, strict=True):
        plant.SetPositions(context, q)
        plant.SetVelocities(context, v)
        forces = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, forces)
        torques.append(plant.CalcInverseDynamics(context, a, forces))
    friction = subject.coulomb * np.sign(motion[1]) + subject.viscous * motion[1]
    return np.array(torques) + friction


def test_robot_that_drake_computes(comau):
    """With the tool, as in the model file, and noise; rotors without coupling, as Drake has it."""
    subject = load_subject("comau_racer_1_4", tool=True)
    regressor = Regressor(subject, coupling=False)
    base = base_parameters(regressor)
    tau = drake_torques("comau_racer_1_4", subject, comau.motion)
    noisy = tau + comau.noise * np.random.default_rng(3).normal(size=(4, *tau.shape))
    record = Record(
        np.arange(4 * len(tau)) * 0.01,
        np.tile(comau.motion[0], (4, 1)),
        noisy.reshape(-1, 6),
        tuple(subject.joint_names),
        10.0,
    )
    result = estimate(regressor, base, average(record, skip=0))
    value = statistic(result, base.values(true_parameters(subject)))
    assert 0.001 < chi2.cdf(value, base.rank) < 0.999
    assert result.variance_factor == pytest.approx(1.0, abs=0.06)
    np.testing.assert_allclose(result.prediction, tau, atol=0.35 * comau.noise.max())


def test_exact_torques_give_exact_parameters(comau, measure):
    result = estimate(comau.regressor, comau.base, measure(noise=1e-6))
    np.testing.assert_allclose(result.base_parameters, comau.truth, atol=1e-5)


def test_formula_of_the_dissertation(comau, measure):
    """(2.80) and its covariance by the normal equations, samples near reversals left out."""
    motion = measure()
    result = estimate(comau.regressor, comau.base, motion, slow=0.05, white=True)
    used = np.abs(motion.v) >= 0.05 * np.abs(motion.v).max(axis=0)
    Y = comau.base.reduce(comau.regressor.matrix(motion.q, motion.v, motion.a))
    weights = 1.0 / np.broadcast_to(motion.mean_torque_variance, used.shape)[used]
    X, b = Y[used], motion.tau[used]
    normal = X.T @ (weights[:, None] * X)
    np.testing.assert_allclose(
        result.base_parameters, np.linalg.solve(normal, X.T @ (weights * b)), rtol=1e-6, atol=1e-9
    )
    np.testing.assert_allclose(result.covariance, np.linalg.inv(normal), rtol=1e-6, atol=1e-12)
    assert result.degrees_of_freedom == used.sum() - 52


def test_errors_are_as_large_as_predicted(comau, measure):
    """Sums of squared errors of many runs, and each parameter's spread."""
    runs = [estimate(comau.regressor, comau.base, measure(seed)) for seed in range(10)]
    total = sum(statistic(run, comau.truth) for run in runs)
    assert 0.001 < chi2.cdf(total, 52 * 10) < 0.999
    errors = [(run.base_parameters - comau.truth) / run.standard_deviation for run in runs]
    assert np.abs(errors).max() < 4.5
    assert np.sum([run.coloured for run in runs]) <= 1


def test_coloured_noise(comau, measure):
    """White noise's covariance is far too small for it, the spectrum's is not."""
    motions = [measure(seed, colour=0.9, periods=5) for seed in range(5)]
    runs = [estimate(comau.regressor, comau.base, motion) for motion in motions]
    assert all(run.coloured.all() for run in runs)
    squares = np.mean([statistic(run, comau.truth) for run in runs])
    assert 52 * 0.8 < squares < 52 * 1.35
    white = estimate(comau.regressor, comau.base, motions[0], white=True)
    assert statistic(white, comau.truth) > 52 * 3
    assert white.base_parameters == pytest.approx(runs[0].base_parameters)


def test_quick(comau):
    motion = comau.trajectory.motion(comau.trajectory.sample_times(500.0))
    tau = comau.regressor.matrix(*motion) @ comau.parameters
    record = Record(
        np.arange(2 * len(tau)) * 2e-3,
        np.tile(motion[0], (2, 1)),
        np.vstack([tau - 0.1, tau + 0.1]),
        tuple(comau.subject.joint_names),
        10.0,
    )
    averaged = average(record, skip=0)
    start = time.process_time()
    estimate(comau.regressor, comau.base, averaged)
    assert time.process_time() - start < 10.0


def still(trajectory, joint):
    a, b = trajectory.a.copy(), trajectory.b.copy()
    a[joint], b[joint] = 0.0, 0.0
    return FourierTrajectory(trajectory.q_0, a, b, trajectory.period, trajectory.harmonics)


def test_joint_that_stands_still(comau, measure):
    """Even if noise of the positions seems to move it."""
    trajectory = still(comau.trajectory, 3)
    q, v, a = trajectory.motion(trajectory.sample_times(100.0))
    with pytest.raises(
        InputError, match=r"joint_4 standing still.*joint_4\.f_c, joint_4\.f_v"
    ) as e:
        estimate(comau.regressor, comau.base, measure(motion=(q, v, a)))
    assert "without effect" in str(e.value)
    noisy = q + 1e-6 * np.random.default_rng(0).normal(size=q.shape)
    with pytest.raises(InputError, match="joint_4 standing still"):
        estimate(comau.regressor, comau.base, measure(motion=(noisy, v, a)))


def test_what_is_badly_identifiable(comau, measure):
    result = estimate(comau.regressor, comau.base, measure())
    weak = result.weak_parameters()
    assert [w.relative_deviation for w in weak] == sorted(
        (r for r in result.relative_standard_deviation if r > 0.15), reverse=True
    )
    worst = {w.name: w for w in weak}["link_6.Ixz"]
    column = result.system.matrix[:, :, result.short_names.index("link_6.Ixz")]
    # as if it were known with all others
    alone = 1.0 / np.sqrt(np.sum(column**2 / result.system.variance * result.system.used))
    size = abs(result.base_parameters[result.short_names.index("link_6.Ixz")])
    assert worst.relative_deviation_alone == pytest.approx(alone / size)
    assert "times the noise (joint_" in worst.reason


def test_bad_input(comau, measure):
    motion = measure()
    zero = replace(motion, torque_variance=np.array([1.0, 1.0, 0.0, 1.0, 1.0, 1.0]))
    with pytest.raises(InputError, match="variance of the torque of joint_3 = 0"):
        estimate(comau.regressor, comau.base, zero)
    with pytest.raises(InputError, match="slow = 1"):
        estimate(comau.regressor, comau.base, motion, slow=1.0)
    with pytest.raises(InputError, match="base parameters of 78 parameters, the regressor has 66"):
        estimate(Regressor(comau.subject, friction=False), comau.base, motion)
    with pytest.raises(InputError, match="tau of shape"):
        estimate(comau.regressor, comau.base, replace(motion, tau=motion.tau[:, :5]))
    nan = motion.tau.copy()
    nan[7, 2] = np.nan
    with pytest.raises(InputError, match="tau has values"):
        estimate(comau.regressor, comau.base, replace(motion, tau=nan))


def test_sizes_are_root_mean_squares_in_units_of_the_noise():
    """``sqrt(mean over time of the sum over joints of (Y / noise)^2)``."""
    rng = np.random.default_rng(6)
    matrix, noise = rng.normal(size=(50, 2, 3)) * [1.0, 20.0, 0.3], np.array([0.5, 4.0])
    v = rng.choice([-1.0, 1.0], (50, 2))
    equations = NormalEquations.of(matrix, v, rng.normal(size=(50, 2)), noise)
    expected = np.sqrt(np.mean(np.sum((matrix / noise[:, None]) ** 2, axis=1), axis=0))
    np.testing.assert_allclose(equations.sizes, expected, rtol=1e-12)
