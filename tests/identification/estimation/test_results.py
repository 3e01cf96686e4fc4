"""Content of the file, read with h5py alone, and read back."""

from dataclasses import replace

import h5py
import numpy as np
import pytest

from identification.estimation.friction_terms import FrictionTerm, FrictionTerms
from identification.estimation.least_squares import estimate
from identification.estimation.repetitions import Repetitions
from identification.estimation.results import load_estimate, save_estimate
from pfsc_drake.errors import InputError


@pytest.fixture(scope="module")
def result(comau, measure):
    terms = FrictionTerms((FrictionTerm(1, "stribeck", 0.3), FrictionTerm(2, "offset")))
    return estimate(comau.regressor, comau.base, measure(), terms)


@pytest.fixture(scope="module")
def runs(result):
    values, covariance = 1.1 * result.base_parameters, 2.0 * result.covariance
    return Repetitions((result, replace(result, base_parameters=values, covariance=covariance)))


@pytest.fixture
def path(tmp_path, result, runs):
    path = tmp_path / "identification.h5"
    save_estimate(path, result, runs)
    return path


def test_somebody_with_h5py(comau, result, path):
    """Solves the linear system again, and finds the regressor of all parameters."""
    with h5py.File(path) as file:
        Y, tau, weights = (file[name][()] for name in ("regressor", "torques", "weights"))
        X = (Y * weights[:, :, None]).reshape(-1, 54)
        again = np.linalg.lstsq(X, (tau * weights).ravel(), rcond=None)[0]
        deviation = file["standard_deviation"][()]
        np.testing.assert_allclose(again, file["base_parameters"][()], atol=1e-6 * deviation.max())
        np.testing.assert_allclose(np.sqrt(np.diag(file["covariance"])), deviation)
        full = Y @ file["projection"][()]
        motion = [file["motion"][name][()] for name in "qva"]
        expected = comau.regressor.matrix(*motion)
        np.testing.assert_allclose(full[:, :, :78], expected, rtol=1e-7, atol=1e-7)
        assert list(file["projection"].attrs["names"][:78]) == comau.regressor.names
        attributes = file["base_parameters"].attrs
        assert list(attributes["short_names"]) == result.short_names
        assert list(attributes["names"]) == result.names
        assert list(attributes["units"]) == result.units
        assert list(file["torques"].attrs["units"]) == ["Nm"] * 6
        assert list(file["motion/v"].attrs["units"]) == ["rad/s"] * 6
        assert file["repetitions/base_parameters"].shape == (2, 54)


def test_comes_back(result, runs, path):
    stored = load_estimate(path)
    got = stored.estimates[0]
    for name in ("base_parameters", "covariance", "residuals"):
        np.testing.assert_array_equal(getattr(got, name), getattr(result, name))
    np.testing.assert_array_equal(got.system.matrix, result.system.matrix)
    assert (got.names, got.units) == (result.names, result.units)
    assert (got.joint_names, got.joint_units) == (result.joint_names, result.joint_units)
    assert got.friction == result.friction
    assert got.condition == pytest.approx(result.condition)
    assert [w.reason for w in got.weak_parameters()] == [w.reason for w in result.weak_parameters()]
    np.testing.assert_array_equal(got.motion.t, result.motion.t)
    assert stored.values.shape == (2, 54)
    np.testing.assert_array_equal(stored.values, runs.values)
    np.testing.assert_array_equal(stored.covariance, runs.covariance)


def test_without_friction_terms_or_repetitions(comau, measure, tmp_path):
    result = estimate(comau.regressor, comau.base, measure())
    save_estimate(tmp_path / "plain.h5", result)
    stored = load_estimate(tmp_path / "plain.h5")
    assert stored.values.shape == (1, 52)
    assert stored.estimates[0].friction == FrictionTerms()


def test_files_that_are_none(path, tmp_path, result):
    (tmp_path / "text.h5").write_text("t, q_1")
    for name in ("missing.h5", "text.h5"):
        with pytest.raises(InputError, match=name):
            load_estimate(tmp_path / name)
    with pytest.raises(InputError, match="cannot be written"):
        save_estimate(tmp_path / "none" / "x.h5", result)
    for name in ("covariance", "motion", "friction"):
        with h5py.File(path, "a") as file:
            stored = file[name]
            del file[name]
            with pytest.raises(InputError, match=r"identification\.h5"):
                file.flush()
                load_estimate(path)
            file[name] = stored
    with h5py.File(path, "a") as file:
        del file["covariance"]
        file["covariance"] = np.eye(3)
    with pytest.raises(InputError, match=r"covariance: float64 of shape \(3, 3\)"):
        load_estimate(path)
