"""Vibration at rest, from made-up references, torques and tools."""

import numpy as np
import pytest

from experiments.results.rest import rest_metrics, rest_warnings
from experiments.results.run_log import RunLog

TIME = np.linspace(0.0, 2.0, 2001)
LIMITS = np.array([10.0, 40.0])


def log_of(amplitude=0.1, shake=1e-6, **attributes):
    """Return a motion from 0.5 to 1.2 s; axis 2 shakes at 50 Hz, the tool too, the latter late."""
    log = RunLog(TIME, turning=[True, True], attributes=attributes)
    eta = np.clip(TIME - 0.5, 0.0, 0.7)
    late = TIME > 1.5
    swing = np.sin(2.0 * np.pi * 50.0 * TIME)
    log.add("eta_p", eta[:, None])
    log.add("tau_d", np.stack([0.0 * TIME + 3.0, amplitude * swing * late], axis=1))
    log.add("y_t", np.outer(eta + shake * swing * late, [0.0, 0.6, 0.8]))
    return log


def test_the_ends_of_rests_are_measured():
    metrics = rest_metrics(log_of(2.0, 1e-5), LIMITS, 0.0)
    shaking, speed = metrics["rest_vibration"], metrics["rest_speed"]
    assert shaking.value == pytest.approx(2 * 2.0 / 40.0, rel=1e-3)
    assert shaking.source == "axis 2, rest until t = 1.980 s"
    assert speed.value == pytest.approx(2.0 * np.pi * 50.0 * 1e-5, rel=0.02)
    (warning,) = rest_warnings(metrics)
    assert "axis 2, rest until t = 1.980 s by 10 % of its limit, tool at 3.1 mm/s" in warning


def test_a_robot_that_rests_is_not_mentioned():
    metrics = rest_metrics(log_of(), LIMITS, 0.0)
    assert metrics["rest_vibration"].value == pytest.approx(0.005, rel=1e-3)
    assert rest_warnings(metrics) == []


def test_what_comes_after_a_fault_does_not_count():
    metrics = rest_metrics(log_of(2.0, fault_time="1.49"), LIMITS, 0.0)
    assert metrics["rest_vibration"].value == 0.0


def test_motions_and_short_rests_do_not_count():
    metrics = rest_metrics(log_of(2.0, fault_time="1.7"), LIMITS, 1.45)
    assert not list(metrics) and rest_warnings(metrics) == []
