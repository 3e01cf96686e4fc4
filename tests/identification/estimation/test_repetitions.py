"""Tables of seven runs against the runs themselves."""

import numpy as np
import pytest

from identification.estimation.friction_terms import FrictionTerm, FrictionTerms
from identification.estimation.least_squares import estimate
from identification.estimation.repetitions import Repetitions
from identification.findings import Findings
from identification.report.tables import parameter_table, torque_table
from pfsc_drake.errors import InputError


@pytest.fixture(scope="module")
def runs(comau, measure):
    return Repetitions(
        tuple(estimate(comau.regressor, comau.base, measure(seed)) for seed in range(7))
    )


def test_table_of_parameters(comau, runs):
    rows = parameter_table(Findings(runs, truth=comau.truth)).rows
    assert [row[0] for row in rows] == [str(number) for number in range(1, 53)]
    values = np.array([run.base_parameters for run in runs.estimates])
    for row, column, truth in zip(rows, values.T, comau.truth, strict=True):
        assert row[2] == pytest.approx(column.mean())
        spread = np.sqrt(np.sum((column - column.mean()) ** 2) / 6.0)
        assert row[4] == pytest.approx(100.0 * spread / abs(column.mean()))
        assert row[6] == truth
    (f_c,) = [row for row in rows if row[1] == "joint_1.f_c"]
    assert f_c[3] == "Nm"
    assert "true" not in parameter_table(Findings(runs)).head


def test_table_of_torques(comau, runs):
    """Torques that are predicted well: the error is the noise, as printed in Tab. C.4."""
    np.testing.assert_allclose(runs.noise_level, comau.noise, rtol=0.03)
    np.testing.assert_allclose(runs.error_rms, comau.noise, rtol=0.03)
    assert np.all((runs.explained > 0.85) & (runs.explained < 1.0))
    rows = torque_table(Findings(runs)).rows
    assert [row[:2] for row in rows] == [[f"joint_{j}", "Nm"] for j in range(1, 7)]
    np.testing.assert_allclose([row[2] for row in rows], runs.noise_level)
    np.testing.assert_allclose([row[4] for row in rows], 100.0 * runs.explained)


def test_spread_is_as_predicted(runs):
    test = runs.spread_test()
    assert test.degrees_of_freedom == 6 * 52
    assert 0.001 < test.p_value <= 1.0
    assert test.median_ratio == pytest.approx(1.0, abs=0.15)


def test_mean_of_the_runs(comau, runs):
    """Its errors are not larger than predicted; nor much smaller."""
    errors = (runs.mean - comau.truth) / np.sqrt(np.diag(runs.covariance_of_mean))
    assert np.abs(errors).max() < 4.0
    assert 0.6 < np.sqrt(np.mean(errors**2)) < 1.2
    wider = np.maximum(runs.standard_deviation, runs.predicted_standard_deviation)
    deviation = np.sqrt(np.diag(runs.covariance_of_mean))
    np.testing.assert_allclose(deviation, wider / np.sqrt(7.0))


def test_friction_that_is_another_in_each_run(comau, measure):
    """Noise explains the spread of a run, not what changes between them."""
    rng = np.random.default_rng(0)
    sign = np.sign(comau.motion[1])
    estimates = []
    for seed in range(4):
        extra = sign * 0.1 * comau.subject.coulomb * rng.normal(size=6)
        estimates.append(estimate(comau.regressor, comau.base, measure(seed, extra=extra)))
    runs = Repetitions(tuple(estimates))
    assert runs.spread_test().p_value < 1e-6
    bodies = runs.spread_test(friction=False)
    assert bodies.degrees_of_freedom == 3 * 40
    assert bodies.p_value > 0.001


def test_what_does_not_belong_together(comau, measure, runs):
    with pytest.raises(InputError, match="no estimate"):
        Repetitions(())
    terms = FrictionTerms((FrictionTerm(0, "offset"),))
    other = estimate(comau.regressor, comau.base, measure(), terms)
    with pytest.raises(InputError, match="run 2 is of 53 parameters of comau"):
        Repetitions((runs.estimates[0], other))
    single = Repetitions(runs.estimates[:1])
    np.testing.assert_allclose(single.covariance_of_mean, runs.estimates[0].covariance)
    assert np.isnan(single.standard_deviation).all()
    assert "of the runs in %" not in parameter_table(Findings(single)).head
    with pytest.raises(InputError, match="one run; at least two"):
        single.spread_test()
