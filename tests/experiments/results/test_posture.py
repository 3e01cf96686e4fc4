"""What happens to an arm beside its tool: pushes on its links, its elbow, its posture."""

import math

import numpy as np
import pytest

from experiments.results.posture import elbow_shift, elbow_travel, lap_before, posture_metrics
from experiments.results.run_log import RunLog
from tests.experiments.results.registry_names import names_about

LAP = 1.0


@pytest.fixture
def log():
    """Seven joints over two and a half laps; in the second lap joint 3 is 0.1 rad off."""
    time = np.linspace(0.0, 5.0, 5001)
    eta = np.minimum(0.5 * time, 2.3)
    q = np.outer(np.sin(2.0 * np.pi * eta / LAP), np.ones(7))
    q[:, 2] += 0.1 * (eta > 1.2) * (eta < 1.8)
    log = RunLog(time)
    log.add("q_J", q, "rad")
    log.add("v_J", np.gradient(q, time, axis=0), "rad/s")
    log.add("q_posture", q + 0.02, "rad")
    log.add("eta", eta, "m")
    log.add("eta_dot", np.gradient(eta, time), "m/s")
    log.add("xi", np.zeros((5001, 2)), "m")
    log.add("phi", np.zeros((5001, 3)), "rad")
    pushed = (eta > 1.2) & (eta < 1.8)
    log.add("push_force", np.outer(pushed, [3.0, 4.0, 0.0, 0.0, 0.0, 1.0]), "N")
    log.add("elbow", np.outer(0.5 * q[:, 0] + 0.1 * pushed, [1.0, 0.0, 0.0]), "m")
    return log


def test_all_metrics(log):
    metrics = posture_metrics(log, LAP)
    about = ("q_posture", "redundant", "push_force")
    assert list(metrics) == names_about(log, *about, also=("redundant", "closed"))
    assert metrics["max_posture_error"].value == pytest.approx(0.02)
    assert metrics["posture_return"].value == pytest.approx(0.1, rel=1e-3)
    assert metrics["final_joint_speed"].value == pytest.approx(0.0, abs=1e-9)
    assert metrics["largest_push"].value == pytest.approx(5.0)


def test_servos_log_no_rate_of_progress(log):
    """It is told from progress then."""
    bare = RunLog(log.time)
    for name in ("q_J", "v_J", "eta", "xi", "phi"):
        bare.add(name, log[name].values, log[name].unit)
    expected, metrics = posture_metrics(log, LAP), posture_metrics(bare, LAP)
    for name in ("posture_return", "final_joint_speed"):
        assert metrics[name].value == pytest.approx(expected[name].value, abs=1e-9)
    bare["eta"].values[:, 0] = 0.5 * log.time
    assert math.isnan(posture_metrics(bare, None)["final_joint_speed"].value)


def test_a_run_that_ends_in_motion_has_no_final_speed(log):
    log["eta_dot"].values[:] = 0.5
    assert math.isnan(posture_metrics(log, LAP)["final_joint_speed"].value)


def test_without_a_second_lap_the_posture_does_not_return(log):
    assert math.isnan(posture_metrics(log, 2.5)["posture_return"].value)
    assert "posture_return" not in posture_metrics(log, None)


def test_what_joints_do_before_the_tool_sets_off_does_not_count(log):
    """It rests for 0.2 s, its joints not yet; the second lap ends where they did so."""
    resting = log.time < 0.2
    for name in ("q_J", "eta", "eta_dot"):
        values = log[name].values
        values[200:] = values[:-200].copy()
    log["eta"].values[resting] = 1e-7 * np.sin(log.time[resting])[:, None]
    log["eta_dot"].values[resting] = 0.0
    log["q_J"].values[resting, 5] = 0.3 * np.exp(-30.0 * log.time[resting])
    metrics = posture_metrics(log, LAP)
    assert metrics["posture_return"].value == pytest.approx(0.1, rel=1e-2)


def test_the_elbows_travel_is_from_its_undisturbed_motion(log):
    elbow, eta = log["elbow"].values, log["eta"].values[:, 0]
    disturbed = log["push_force"].values.any(axis=1)
    undisturbed = lap_before(eta, elbow, disturbed, LAP)
    expected = 0.5 * np.sin(2.0 * np.pi * eta / LAP)
    np.testing.assert_allclose(undisturbed[:, 0], expected, atol=4e-4)
    # without it: from where it was when the push began, the tool's own motion included
    assert elbow_travel(log) > 0.2
    log.add("elbow_undisturbed", undisturbed, "m")
    assert elbow_travel(log) == pytest.approx(0.1, rel=1e-3)


def test_a_push_while_the_tool_rests_after_a_lap():
    """A hair before or beyond the lap's end; what it did before the lap began is forgotten."""
    eta = np.concatenate([np.zeros(50), np.linspace(0.0, 0.99995, 500), np.full(50, 1.00004)])
    eta = np.concatenate([eta, np.linspace(1.00004, 1.5, 250)])
    values = np.sin(2.0 * np.pi * eta)[:, None]
    values[:20] += 0.5
    expected = lap_before(eta, values, np.arange(len(eta)) > 560, LAP)
    np.testing.assert_allclose(expected, values, atol=2e-3)


def test_no_lap_before_no_undisturbed_motion(log):
    elbow, eta = log["elbow"].values, log["eta"].values[:, 0]
    assert lap_before(eta, elbow, eta > 0.5, LAP) is None
    assert lap_before(eta, elbow, eta > 9.0, LAP) is None


def test_square_robots_have_none_of_them(log):
    for name in ("q_posture", "push_force"):
        del log.signals[name]
    log["q_J"].values = log["q_J"].values[:, :6]
    assert not posture_metrics(log, LAP)
    assert not names_about(log, "q_posture", "redundant", "push_force", also=("closed",))


def test_what_the_elbow_does_before_it_is_pushed_is_no_shift(log):
    first = int(np.argmax(log["push_force"].values[:, 0] > 0.0))
    assert np.ptp(log["elbow"].values[:first, 0]) > 0.5
    shift = elbow_shift(log)
    assert not shift[:first].any()
    elbow = log["elbow"].values
    np.testing.assert_allclose(shift[first:], elbow[first:] - elbow[first])
    log["push_force"].values[:] = 0.0
    assert not elbow_shift(log).any()


def test_what_the_elbow_does_after_it_is_pushed_is_no_travel(log):
    travel, pushed = elbow_travel(log), log["push_force"].values.any(axis=1)
    last = np.flatnonzero(pushed)[-1]
    log["elbow"].values[last + 1 :] += 9.0
    assert elbow_travel(log) == travel
    assert np.abs(elbow_shift(log)).max() > 8.0
