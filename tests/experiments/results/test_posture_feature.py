"""Posture of redundant arms and conditioning, from made-up logs."""

import math

import numpy as np
import pytest

from experiments.results.features import draw_figures
from experiments.results.posture_feature import draw_conditioning, draw_posture, posture_metrics
from experiments.results.run_log import RunLog
from tests.experiments.results.registry_names import names_about
from tests.shades import shades

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


def test_square_robots_have_none_of_them(log):
    for name in ("q_posture", "push_force"):
        del log.signals[name]
    log["q_J"].values = log["q_J"].values[:, :6]
    assert not posture_metrics(log, LAP)
    assert not names_about(log, "q_posture", "redundant", "push_force", also=("closed",))


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


def test_posture_error_and_swivel_angle(pushed_log):
    pushed_log.add("q_posture", pushed_log["q_J"].values - 0.1, "rad")
    pushed_log.add("swivel", np.tile([0.2, 0.3], (201, 1)), "rad")
    panels = draw_posture(pushed_log).canvas.axes
    assert drawn(panels[0], "axis 3") == pytest.approx(np.rad2deg(0.1))
    assert drawn(panels[1], "swivel angle") == pytest.approx(np.rad2deg(0.2))
    assert drawn(panels[1], "reference") == pytest.approx(np.rad2deg(0.3))
    labels = [shown.get_label() for shown in shades(panels[0])]
    assert labels == ["tool pushed", "link pushed"]


@pytest.mark.slow
def test_conditioning_over_time_and_path(drawn_log):
    drawn_log.add("rcond", np.full(201, 0.05), "1", limits=[[1e-3, np.inf]])
    assert draw_conditioning(drawn_log) is None  # as many joints as coordinates, far from singular
    drawn_log["rcond"].values[7] = 5e-3
    assert draw_conditioning(drawn_log)
    drawn_log["rcond"].values[9] = 0.0  # of a law that stopped
    panels = draw_conditioning(drawn_log).canvas.axes
    assert panels[1].get_xlabel() == r"$\eta$ in m"
    assert panels[1].lines[0].get_xdata()[-1] == pytest.approx(0.3)
    for panel in panels:
        assert drawn(panel, "threshold")[0] == 1e-3
        assert np.isnan(drawn(panel, "conditioning")[9])
    drawn_log["rcond"].values[:] = 0.05
    del drawn_log.signals["phi"]
    assert draw_conditioning(drawn_log)  # spare joints
    names = [drawing.name for drawing in draw_figures(drawn_log, [np.zeros((2, 3))])]
    assert "conditioning" in names
