"""Vibration at rest and motion after a fault, from made-up references, torques and joints."""

import numpy as np
import pytest

from diagrams.scenario import Scenario
from experiments.results.joint_limits_feature import DriveLimitsOfRun
from experiments.results.requirements import set_targets
from experiments.results.rest_feature import MotionAfterFault, rest_metrics
from experiments.results.run_log import RunLog
from reporting.metrics import NARROW_SPACE

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
    set_targets(metrics, Scenario())
    assert shaking.passed is False and speed.passed is False


def test_a_robot_that_rests_is_not_mentioned():
    metrics = rest_metrics(log_of(), 0.0)
    assert metrics["rest_vibration"].value == pytest.approx(0.005, rel=1e-3)
    set_targets(metrics, Scenario())
    assert metrics["rest_vibration"].passed and metrics["rest_speed"].passed


def test_what_comes_after_a_fault_does_not_count():
    metrics = rest_metrics(log_of(2.0, fault_time="1.49"), 0.0)
    assert metrics["rest_vibration"].value == 0.0


def test_motions_and_short_rests_do_not_count():
    metrics = rest_metrics(log_of(2.0, fault_time="1.7"), 1.45)
    set_targets(metrics, Scenario())
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
    assert shaking.source.startswith("axis 2 of the workpiece robot, rest until")


JOINTS = DriveLimitsOfRun(
    ["turn", "slide"], np.array([True, False]), np.full((2, 2), np.inf), np.full(2, np.inf)
)


def motion(turning, sliding):
    """Return what there is to say of speeds after a fault at 0.5 s; before it 0.4 rad/s, 0.2 m/s.

    The tool moves as the slide does.
    """
    after = TIME >= 0.5
    v = np.stack(
        [np.where(after, turning(TIME - 0.5), 0.4), np.where(after, sliding(TIME - 0.5), 0.2)],
        axis=1,
    )
    q = np.vstack([np.zeros(2), np.cumsum(v[:-1] * np.diff(TIME)[:, None], axis=0)])
    log = RunLog(TIME, turning=[True, False], attributes={"fault_time": "0.500000"})
    log.add("q_J", q)
    log.add("v_J", v)
    log.add("y_t", np.outer(q[:, 1], [0.0, 1.0, 0.0]))
    return MotionAfterFault(log, JOINTS)


def ramp(speed, duration):
    return lambda t: speed * np.maximum(1.0 - t / duration, 0.0)


def test_a_stop_is_within_its_bound():
    """Half of the speed times the duration."""
    found = motion(ramp(0.4, 0.3), ramp(0.2, 0.5))
    metrics = found.metrics()
    turned, slid = metrics["motion_after_fault"], metrics["slide_motion_after_fault"]
    assert turned.value == pytest.approx(0.06, rel=0.01) and turned.passed
    assert slid.value == pytest.approx(0.05, rel=0.01) and slid.passed
    assert turned.bound == ("<=", pytest.approx(0.3)) and slid.bound == ("<=", pytest.approx(0.12))
    assert found.rests
    words = found.sentence().replace(NARROW_SPACE, " ")
    assert words.startswith("stopped at t = 2.000 s; after the fault joint 1 moved 60")
    assert words.endswith(" mrad, the tool 50.1 mm")


def test_a_joint_that_runs_away_is_named_with_its_speed():
    found = motion(lambda t: 0.4 + 0.5 * t, ramp(0.2, 0.5))
    assert found.metrics()["motion_after_fault"].passed is False
    assert found.metrics()["slide_motion_after_fault"].passed
    assert not found.rests
    assert "still moving at t = 2.000 s, joint 1 at 1.15 rad/s" in found.sentence()
    assert "stopped" not in found.sentence()


def test_a_slide_that_creeps_is_no_stop():
    found = motion(ramp(0.4, 0.3), lambda t: np.full_like(t, 0.2))
    assert found.metrics()["slide_motion_after_fault"].passed is False
    assert "still moving at t = 2.000 s, joint 2 at 0.2 m/s" in found.sentence()
