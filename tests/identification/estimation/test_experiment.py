"""The whole way: a DELTA robot moves in Drake with sticking friction, servo, encoders and noise."""

from functools import cache

import numpy as np
import pytest

from identification.estimation.least_squares import estimate
from identification.estimation.residuals import excess
from identification.estimation.validation import compare_with_truth, predict
from identification.excitation.fourier import FourierTrajectory
from identification.measurement.experiment import run_experiment
from identification.measurement.periods import average
from identification.model.base import base_parameters
from identification.model.dynamic_parameters import true_parameters
from identification.model.regressor import Regressor
from identification.model.subject import load_subject

# velocity amplitudes [m/s] of the harmonics 1 to 3, joints in rows
_A = np.array([[0.15, 0.30, 0.1], [0.10, -0.25, 0.3], [-0.15, 0.2, 0.25]])
_B = np.array([[0.20, -0.1, 0.25], [-0.2, 0.15, 0.1], [0.1, 0.3, -0.2]])


@pytest.fixture(scope="module")
def delta():
    subject = load_subject("festo_expt_45")
    regressor = Regressor(subject)
    return subject, regressor, base_parameters(regressor)


@pytest.fixture(scope="module")
def measured(delta):
    """Return a function that carries out one of two experiments, once."""
    excitation = FourierTrajectory(np.full(3, 0.2), _A, _B, 2.0, (1, 2, 3))
    other = FourierTrajectory(np.full(3, 0.2), 0.8 * _B[::-1], -0.8 * _A, 2.0, (1, 2, 3))

    @cache
    def get(k):
        trajectory = (excitation, other)[k]
        return average(run_experiment(delta[0], trajectory, periods=4, seed=k).record)

    return get


def test_estimate_of_simulated_experiment(delta, measured):
    subject, regressor, base = delta
    result = estimate(regressor, base, measured(0))
    test = compare_with_truth(result, base.values(true_parameters(subject)))
    assert test.degrees_of_freedom == 10
    assert test.p_value > 0.01
    assert np.all(result.relative_standard_deviation < 0.05)
    system = result.system
    assert (excess(result.residuals, system.used, measured(0), parameters=10).p_value > 1e-3).all()


@pytest.mark.slow
def test_prediction_of_another_experiment(delta, measured):
    _, regressor, base = delta
    prediction = predict(estimate(regressor, base, measured(0)), regressor, measured(1))
    np.testing.assert_allclose(prediction.error_rms, prediction.noise_level, rtol=0.15)
    assert np.all(prediction.explained > 0.9)
    found = excess(prediction.residuals, prediction.used, measured(1))
    assert (found.p_value > 1e-4).all()
