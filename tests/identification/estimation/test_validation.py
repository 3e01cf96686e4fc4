"""Plausibility of an estimate: predicted motions, ground truth, impossible signs."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from identification.estimation.friction_terms import FrictionTerm, FrictionTerms
from identification.estimation.least_squares import estimate
from identification.estimation.validation import compare_with_truth, predict, refuse_implausible
from pfsc_drake.errors import InputError


@pytest.fixture(scope="module")
def result(comau, measure):
    return estimate(comau.regressor, comau.base, measure())


@pytest.fixture(scope="module")
def other(other_trajectory):
    return other_trajectory.motion(other_trajectory.sample_times(100.0))


def test_prediction_of_another_motion(comau, result, measure, other):
    prediction = predict(result, comau.regressor, measure(5, motion=other))
    exact = comau.regressor.matrix(*other) @ comau.parameters
    off = np.sqrt(np.mean((prediction.predicted - exact) ** 2, axis=0))
    assert np.all(off < 3.0 * prediction.uncertainty)
    assert np.all(off < 0.4 * comau.noise)
    np.testing.assert_allclose(prediction.error_rms, comau.noise, rtol=0.1)
    np.testing.assert_allclose(prediction.noise_level, comau.noise, rtol=0.05)
    np.testing.assert_allclose(prediction.variance_factor, 1.0, atol=0.3)
    share = 1.0 - prediction.rms**2 / np.var(prediction.measured, axis=0)
    np.testing.assert_allclose(prediction.explained, share, atol=1e-3)
    assert prediction.units == ("Nm",) * 6


def test_error_of_single_torques(comau, result):
    """From means and variances, without the single torques themselves."""
    prediction = predict(result, comau.regressor, result.motion)
    single = result.motion.tau_periods - prediction.predicted
    variance = np.mean((result.motion.tau_periods - result.motion.tau) ** 2, axis=(0, 1))
    np.testing.assert_allclose(
        result.motion.torque_variance - result.motion.mean_torque_variance, variance
    )
    np.testing.assert_allclose(prediction.error_rms, np.sqrt(np.mean(single**2, axis=(0, 1))))


def test_prediction_with_friction_terms(comau, measure, other):
    model = FrictionTerms((FrictionTerm(2, "offset"), FrictionTerm(0, "slant")))
    fitted = estimate(comau.regressor, comau.base, measure(noise=1e-5), model)
    np.testing.assert_allclose(fitted.base_parameters[-2:], 0.0, atol=1e-3)
    prediction = predict(fitted, comau.regressor, measure(5, motion=other, noise=1e-5))
    assert np.all(prediction.explained > 0.999999)


def test_friction_of_another_day(comau, result, measure, other):
    """10 % more in all joints is seen."""
    extra = 0.1 * comau.subject.coulomb * np.sign(other[1])
    plain = predict(result, comau.regressor, measure(5, motion=other, extra=extra))
    assert plain.variance_factor.max() > 2.0


def test_truth(comau, result):
    test = compare_with_truth(result, comau.truth)
    error = result.base_parameters - comau.truth
    information = np.linalg.inv(result.covariance)
    assert test.chi_squared == pytest.approx(error @ information @ error, rel=1e-6)
    assert test.p_value > 0.01
    assert test.degrees_of_freedom == 52
    np.testing.assert_allclose(test.standard_errors, error / result.standard_deviation)
    wrong = comau.truth.copy()
    wrong[3] += 8.0 * result.standard_deviation[3]
    assert compare_with_truth(result, wrong).p_value <= 0.01
    cautious = replace(result, covariance=9.0 * result.covariance)
    small = compare_with_truth(cautious, comau.truth)
    assert small.p_value == pytest.approx(2.0 * chi2.cdf(test.chi_squared / 9.0, 52))
    assert small.p_value <= 0.01


def test_truth_that_is_none(comau, result):
    with pytest.raises(InputError, match=r"truth of shape \(51,\)"):
        compare_with_truth(result, comau.truth[1:])
    unknown = comau.truth.copy()
    unknown[-1] = np.nan
    with pytest.raises(InputError, match=r"the true joint_6\.f_v is not known"):
        compare_with_truth(result, unknown)


def found(comau, measured, friction=None, white=True):
    return estimate(comau.regressor, comau.base, measured, friction, white=white)


@pytest.mark.parametrize("seed", range(4))
def test_a_sound_estimate_passes(comau, measure, seed):
    refuse_implausible(found(comau, measure(seed)))
    refuse_implausible(found(comau, measure(seed, noise=10.0, colour=0.9), white=False))


@pytest.mark.parametrize(("name", "joint"), [("f_c", 6), ("f_v", 4), ("I_M", 5)])
def test_what_cannot_be_negative_is_refused(comau, measure, name, joint):
    index = comau.regressor.names.index(f"joint_{joint}.{name}")
    column = comau.regressor.matrix(*comau.motion)[..., index]
    extra = -3.0 * comau.parameters[index] * column
    with pytest.raises(InputError, match=rf"joint_{joint}\.{name} = -.* cannot be negative"):
        refuse_implausible(found(comau, measure(extra=extra)))


def test_a_little_below_zero_is_chance(comau, measure):
    """No friction at all, and noise: half of the estimates are below zero."""
    index = comau.regressor.names.index("joint_6.f_v")
    column = comau.regressor.matrix(*comau.motion)[..., index]
    below = 0
    for seed in range(6):
        estimated = found(comau, measure(seed, extra=-comau.parameters[index] * column))
        refuse_implausible(estimated)
        names = estimated.robot_base.short_names
        below += estimated.base_parameters[names.index("joint_6.f_v")] < 0.0
    assert 0 < below < 6


def test_friction_of_another_form_may_have_a_negative_part(comau, measure):
    """Friction that grows with the square of the velocity: Coulomb's alone is below zero."""
    v = comau.motion[1][:, 5]
    names = comau.regressor.names
    own = [names.index(f"joint_6.{name}") for name in ("f_c", "f_v")]
    extra = np.zeros((len(v), 6))
    extra[:, 5] = 3.0 * v * np.abs(v)
    extra -= comau.regressor.matrix(*comau.motion)[..., own] @ comau.parameters[own]
    measured = measure(extra=extra)
    with pytest.raises(InputError, match=r"joint_6\.f_c = -.*--validation"):
        refuse_implausible(found(comau, measured))
    term = FrictionTerms((FrictionTerm(5, "quadratic"),))
    refuse_implausible(found(comau, measured, term))
    driving = measure(extra=-2.0 * extra)
    with pytest.raises(InputError, match=r"friction of joint_6 against .* cannot be negative"):
        refuse_implausible(found(comau, driving, term))


def test_torques_that_the_model_does_not_explain(comau, measure):
    extra = np.zeros_like(comau.motion[0])
    extra[:, 1] = 300.0 * np.sin(7.0 * comau.motion[0][:, 1])
    with pytest.raises(InputError, match=r"tau of joint_2: [\d.]+ times the noise .* gravity"):
        refuse_implausible(found(comau, measure(extra=extra)))
