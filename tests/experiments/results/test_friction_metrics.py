"""Metrics of what is thought of friction, on logs made by hand."""

import numpy as np
import pytest

from experiments.results.friction_metrics import friction_metric_names, friction_metrics
from experiments.results.run_log import RunLog


def make_log():
    log = RunLog(np.linspace(0.0, 1.0, 5))
    log.add("tau_f", np.outer(np.ones(5), [3.0, -4.0]), "Nm")
    log.add("friction_estimate", np.outer(np.ones(5), [3.5, -4.0]), "Nm")
    log.add("f_c", np.outer(np.linspace(1.0, 2.0, 5), [10.0, 0.0]), "Nm")
    log.add("f_c_estimate", np.outer(np.ones(5), [19.0, 1.0]), "Nm")
    log.add("f_v", np.outer(np.ones(5), [4.0, 8.0]), "Nm s/rad")
    log.add("f_v_estimate", np.outer(np.ones(5), [4.2, 6.0]), "Nm s/rad")
    return log


def test_errors_of_torques_and_of_coefficients_at_the_end():
    metrics = friction_metrics(make_log())
    assert metrics["rms_friction_error_1"].value == pytest.approx(0.5)
    assert metrics["rms_friction_error_2"].value == 0.0
    assert metrics["coulomb_error_1"].value == pytest.approx(0.05)
    assert np.isnan(metrics["coulomb_error_2"].value)  # there is no such friction
    assert metrics["max_coulomb_error"].value == pytest.approx(0.05)
    assert metrics["max_viscous_error"].value == pytest.approx(0.25)
    assert metrics["viscous_error_1"].value == pytest.approx(0.05)


def test_names_are_those_of_the_metrics():
    log = make_log()
    assert list(friction_metrics(log)) == friction_metric_names(2, log.signals)
    bare = RunLog(np.linspace(0.0, 1.0, 5))
    assert not friction_metrics(bare)
    assert not friction_metric_names(2, bare.signals)
