"""From motions to parameters and a consistent set, with torques made by the regressor."""

from types import SimpleNamespace

import numpy as np
import pytest

from identification.consistency.bounds import load_bounds
from identification.excitation.fourier import FourierTrajectory
from identification.findings import consistent_set, find_parameters
from identification.measurement.periods import average
from identification.measurement.record import Record
from identification.model.base import base_parameters
from identification.model.dynamic_parameters import true_parameters
from identification.model.regressor import Regressor
from identification.model.subject import load_subject
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import models_directory

NOISE, PERIODS, RATE = 2.0, 4, 200.0


@pytest.fixture(name="delta", scope="module")
def fixture_delta():
    subject = load_subject("festo_expt_45", tool=False)
    regressor = Regressor(subject)
    file = models_directory() / subject.name / "excitation_optimal.yaml"
    return SimpleNamespace(
        subject=subject,
        regressor=regressor,
        base=base_parameters(regressor),
        truth=true_parameters(subject),
        trajectory=FourierTrajectory.load(file),
    )


def measured(delta, seed, trajectory=None, further=None):
    """Return the average of a record with white noise."""
    trajectory = trajectory or delta.trajectory
    q, v, a = trajectory.motion(trajectory.sample_times(RATE))
    tau = delta.regressor.matrix(q, v, a) @ delta.truth
    tau = np.tile(tau if further is None else tau + further(v), (PERIODS, 1))
    tau += NOISE * np.random.default_rng(seed).normal(size=tau.shape)
    t = np.arange(len(tau)) / RATE
    names = tuple(delta.subject.joint_names)
    return average(Record(t, np.tile(q, (PERIODS, 1)), tau, names, trajectory.period), skip=0)


def slower(trajectory):
    """Return another motion within the same limits: to and fro the other way."""
    return FourierTrajectory(
        trajectory.q_0, -trajectory.a, trajectory.b, trajectory.period, trajectory.harmonics
    )


def test_runs_scatter_about_the_truth_as_predicted(delta):
    motions = [measured(delta, seed) for seed in range(5)]
    found = find_parameters(delta.regressor, delta.base, motions, truth=delta.truth)
    assert found.choice is None and found.prediction is None
    errors = (found.runs.values - found.truth) / found.runs.predicted_standard_deviation
    assert 0.7 < np.sqrt(np.mean(errors**2)) < 1.3
    assert found.truth_test.degrees_of_freedom == 4  # masses; friction is another one each day
    assert found.truth_test.p_value > 1e-3


def test_friction_that_data_ask_for_is_chosen_and_predicts(delta):
    def stribeck(v):
        return 4.0 * np.sign(v) * np.exp(-np.abs(v) / 0.1)

    other = measured(delta, 9, slower(delta.trajectory), stribeck)
    reports = []
    found = find_parameters(
        delta.regressor,
        delta.base,
        [measured(delta, 1, further=stribeck)],
        other,
        truth=delta.truth,
        progress=lambda fraction, phase: reports.append((fraction, phase)),
    )
    assert {term.joint for term in found.estimate.friction.terms} == {0, 1, 2}
    plain = find_parameters(
        delta.regressor, delta.base, [found.estimate.motion], other, choose=False
    )
    assert np.all(found.prediction.rms < plain.prediction.rms)
    # (0, ..) of what the robot does not have
    assert found.truth.size == found.estimate.base.rank > delta.base.rank
    assert reports[0] == (0.0, "choosing friction")
    assert reports[-1][0] == 1.0


def test_the_consistent_set_is_that_of_all_runs(delta):
    found = find_parameters(
        delta.regressor, delta.base, [measured(delta, seed) for seed in range(4)]
    )
    consistent = consistent_set(found, load_bounds("festo_expt_45"), direct=False)
    mean = delta.base.values(consistent.parameters)
    deviation = (mean - found.runs.mean) / np.sqrt(np.diag(found.runs.covariance_of_mean))
    # slides of the parameter file weigh the same
    assert np.abs(deviation).max() < 4.0
    np.testing.assert_allclose(consistent.parameters, delta.truth, rtol=0.05)


def test_no_motion_is_refused(delta):
    with pytest.raises(InputError, match="no record"):
        find_parameters(delta.regressor, delta.base, [])
