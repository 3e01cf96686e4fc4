"""Vibration at rest, from made-up references, torques and tools."""

import numpy as np
import pytest

from experiments.results.rest import rest_metrics, set_rest_targets
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
    torques = np.stack([0.0 * TIME + 3.0, amplitude * swing * late], axis=1)
    log.add("tau_d", torques, limits=LIMITS)
    log.add("y_t", np.outer(eta + shake * swing * late, [0.0, 0.6, 0.8]))
    return log


def test_the_ends_of_rests_are_measured():
    metrics = rest_metrics(log_of(2.0, 1e-5), 0.0)
    shaking, speed = metrics["rest_vibration"], metrics["rest_speed"]
    assert shaking.value == pytest.approx(2 * 2.0 / 40.0, rel=1e-3)
    assert shaking.source == "axis 2, rest until t = 1.980 s"
    assert speed.value == pytest.approx(2.0 * np.pi * 50.0 * 1e-5, rel=0.02)
    set_rest_targets(metrics)
    assert shaking.passed is False and speed.passed is False


def test_a_robot_that_rests_is_not_mentioned():
    metrics = rest_metrics(log_of(), 0.0)
    assert metrics["rest_vibration"].value == pytest.approx(0.005, rel=1e-3)
    set_rest_targets(metrics)
    assert metrics["rest_vibration"].passed and metrics["rest_speed"].passed


def test_what_comes_after_a_fault_does_not_count():
    metrics = rest_metrics(log_of(2.0, fault_time="1.49"), 0.0)
    assert metrics["rest_vibration"].value == 0.0


def test_motions_and_short_rests_do_not_count():
    metrics = rest_metrics(log_of(2.0, fault_time="1.7"), 1.45)
    set_rest_targets(metrics)
    assert not list(metrics)


@pytest.mark.parametrize(
    "name", ["q_posture", "holder_eta_p", "holder_xi_p", "holder_phi_p", "turntable_angles"]
)
def test_robots_of_which_anything_is_to_move_do_not_rest(name):
    log = log_of(2.0)
    log.add(name, np.outer(np.maximum(TIME - 1.4, 0.0), [0.0, 1e-3]))
    assert rest_metrics(log, 0.0)["rest_vibration"].value == 0.0


def test_the_robot_that_holds_the_workpiece_rests_as_well():
    log = log_of()
    swing = np.sin(2.0 * np.pi * 70.0 * TIME)
    log.add("holder_tau_d", np.stack([0.0 * TIME, 1.5 * swing], axis=1), limits=LIMITS / 2.0)
    shaking = rest_metrics(log, 0.0)["rest_vibration"]
    assert shaking.value == pytest.approx(2 * 1.5 / 20.0, rel=1e-2)
    assert shaking.source.startswith("axis 2 of the robot that holds the workpiece, rest until")
