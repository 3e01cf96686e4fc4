"""Pushes on links and the way of the elbow, from made-up logs."""

import numpy as np
import pytest

from experiments.results.posture_feature import posture_metrics
from experiments.results.pushes_feature import (
    draw_pushes,
    elbow_shift,
    elbow_travel,
    previous_revolution,
    push_metrics,
)
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
    metrics = posture_metrics(log, LAP) | push_metrics(log)
    about = ("q_posture", "redundant", "push_force")
    assert list(metrics) == names_about(log, *about, also=("redundant", "closed"))
    assert metrics["max_posture_error"].value == pytest.approx(0.02)
    assert metrics["posture_return"].value == pytest.approx(0.1, rel=1e-3)
    assert metrics["final_joint_speed"].value == pytest.approx(0.0, abs=1e-9)
    assert metrics["largest_push"].value == pytest.approx(5.0)


def test_the_elbows_travel_is_from_its_undisturbed_motion(log):
    elbow, eta = log["elbow"].values, log["eta"].values[:, 0]
    disturbed = log["push_force"].values.any(axis=1)
    undisturbed = previous_revolution(eta, elbow, disturbed, LAP)
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
    expected = previous_revolution(eta, values, np.arange(len(eta)) > 560, LAP)
    np.testing.assert_allclose(expected, values, atol=2e-3)


def test_no_lap_before_no_undisturbed_motion(log):
    elbow, eta = log["elbow"].values, log["eta"].values[:, 0]
    assert previous_revolution(eta, elbow, eta > 0.5, LAP) is None
    assert previous_revolution(eta, elbow, eta > 9.0, LAP) is None


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


def drawn(panel, label):
    (line,) = [line for line in panel.lines if line.get_label() == label]
    return np.asarray(line.get_ydata())


@pytest.fixture
def pushed_log(drawn_log):
    """Two points are pushed, the first from 0.4 to 0.6 s; it goes 3 mm and 4 mm away."""
    during = (drawn_log.time > 0.4) & (drawn_log.time < 0.6)
    force = np.outer(during, [0.0, 30.0, 0.0, 1.0, 0.0, 0.0])
    labels = [f"{name} {axis}" for name in ("link_4", "hand") for axis in "xyz"]
    drawn_log.add("push_force", force, "N", labels)
    drawn_log.add("elbow", 0.5 + np.outer(during, [3e-3, 4e-3, 0.0]), "m", labels[:3])
    return drawn_log


def test_pushes_and_the_way_of_the_point(pushed_log):
    assert draw_pushes(pushed_log)
    pushed_log["elbow"].values[0] += 1.0  # before the push it does not matter
    # it starts where it is at the first sample with a force
    pushed_log["elbow"].values[81] = 0.5
    panels = draw_pushes(pushed_log).canvas.axes
    titles = [panel.get_title() for panel in panels]
    assert titles[0] == "Force on link_4, world axes"
    assert titles[1] == "Force on hand, world axes"
    assert titles[2] == "Displacement of link_4"
    assert drawn(panels[0], "$f_y$").max() == 30.0
    assert drawn(panels[2], "distance").max() == pytest.approx(5.0)
    assert not drawn(panels[2], "distance")[:81].any()


def test_the_way_is_compared_with_an_undisturbed_motion(pushed_log):
    pushed_log.add("elbow_undisturbed", pushed_log["elbow"].values - 0.001, "m")
    drawing = draw_pushes(pushed_log)
    assert drawn(drawing.canvas.axes[-1], "distance") == pytest.approx(3.0**0.5)
    assert "in the previous revolution" in drawing.caption


def test_no_push_no_figure(pushed_log):
    pushed_log["push_force"].values[:] = 0.0
    assert draw_pushes(pushed_log) is None
