"""Forces on the tool and the ball in its notch: metrics and figures, from made-up logs."""

import math

import numpy as np
import pytest

from experiments.results.features import draw_figures
from experiments.results.forces_feature import (
    draw_damping,
    draw_forces,
    draw_notch_position,
    force_metrics,
)
from experiments.results.run_log import RunLog
from tests.shades import spans


def force(log, name):
    return force_metrics(log)[name].value


def test_forces_count_once_the_sensor_is_tared():
    log = RunLog(np.arange(4.0))
    forces = [[90, 0, 0], [2, 3, 6], [-5, 0, 0], [0, 4, 0]]
    log.add("manifold_force", np.hstack([forces, np.full((4, 3), 50.0)]), "N, Nm")
    assert force(log, "max_manifold_force") == 90.0
    log.add("tared", [0, 1, 1, 1], "1")
    assert force(log, "max_manifold_force") == pytest.approx(7.0)  # sqrt(4 + 9 + 36)
    assert force(log, "max_tangential_force") == 5.0
    log.add("tared", np.zeros(4), "1")
    assert math.isnan(force(log, "max_manifold_force"))
    assert math.isnan(force(log, "max_tangential_force"))


def test_forces_before_the_sensor_is_tared_are_answered_by_nobody():
    log = RunLog(np.arange(3.0))
    log.add("wrench_ext", [[3, 4, 0, 9, 9, 9], [0, 2, 0, 0, 0, 0], [90, 0, 0, 0, 0, 0]], "N, Nm")
    log.add("tared", [0, 0, 1], "1")
    assert force(log, "max_unanswered_force") == 5.0
    log.add("tared", np.ones(3), "1")
    assert force(log, "max_unanswered_force") == 0.0


def test_external_force():
    log = RunLog(np.arange(3.0))
    forces = [[0, 0, 0], [3, -4, 12], [5, 0, 0]]
    log.add("wrench_ext", np.hstack([forces, np.full((3, 3), 50.0)]), "N, Nm")
    assert force(log, "max_external_force") == pytest.approx(13.0)


def test_distance_from_the_notch_axis():
    log = RunLog(np.arange(3.0))
    log.add("notch_position", [[0, 0], [-3e-3, -4e-3], [4e-3, 0]], "m")
    assert force(log, "max_distance_from_notch_axis") == pytest.approx(5e-3)


PUSH = slice(81, 120)  # samples with 0.4 s < t < 0.6 s


def titles(drawing):
    return [panel.get_title() for panel in drawing.canvas.axes]


def lines(panel):
    named = [line for line in panel.lines if not line.get_label().startswith("_")]
    return {line.get_label(): np.asarray(line.get_ydata()) for line in named}


def test_all_panels(drawn_log):
    drawing = draw_forces(drawn_log)
    assert titles(drawing) == [
        "Force along the path's coordinates",
        "Moment along the orientation's coordinates",
        "Measured force, world axes",
        "Measured moment, world axes",
    ]
    labels = [panel.get_ylabel() for panel in drawing.canvas.axes]
    assert labels == ["force in N", "moment in Nm", "force in N", "moment in Nm"]


def test_data_of_the_manifold_force(drawn_log):
    force, moment, *_ = draw_forces(drawn_log).canvas.axes
    along = lines(force)[r"$\tau_\parallel$"]
    np.testing.assert_allclose(along[PUSH], 27.0)
    assert np.all(along[: PUSH.start] == 0.0)
    assert np.all(lines(force)[r"$\tau_\perp$"] == 0.0)
    np.testing.assert_allclose(lines(moment)[r"$\tau_y$"][PUSH], 1.8)


def test_measured_over_acting(drawn_log):
    panel = draw_forces(drawn_log).canvas.axes[2]
    assert set(lines(panel)) == {"actual", "$f_x$", "$f_y$", "$f_z$"}
    np.testing.assert_allclose(lines(panel)["$f_x$"][PUSH], 33.0)
    dashed = [line for line in panel.lines if line.get_linestyle() == "--"]
    np.testing.assert_allclose(dashed[0].get_ydata()[PUSH], 30.0)
    assert len(dashed) == 3
    assert panel.lines[-3:] == dashed  # on top, noise does not hide it


def test_moments_that_are_noise_are_left_out(drawn_log):
    for name in ("manifold_force", "wrench_ext", "wrench_measured"):
        drawn_log[name].values[:, 3:] = 0.01  # Nm, as 30 N have at a lever of a third of a mm
    assert titles(draw_forces(drawn_log)) == [
        "Force along the path's coordinates",
        "Measured force, world axes",
    ]


def test_position_only_has_no_moments(drawn_log):
    drawn_log.add("manifold_force", np.ones((201, 3)), "N", ["tau_par", "tau_perp", "tau_cross"])
    assert titles(draw_forces(drawn_log))[1] == "Measured force, world axes"


def test_acting_alone(drawn_log):
    drawn_log.signals = {"wrench_ext": drawn_log["wrench_ext"]}
    drawing = draw_forces(drawn_log)
    assert titles(drawing) == ["Actual force, world axes", "Actual moment, world axes"]
    np.testing.assert_allclose(lines(drawing.canvas.axes[0])["$f_x$"][PUSH], 30.0)
    assert drawing.caption == "Actual wrench at the tool point."


def test_where_the_sensor_is_not_to_be_trusted(drawn_log):
    panels = draw_forces(drawn_log).canvas.axes
    assert spans(panels[0], "sensor not tared") == [pytest.approx((0.0, 0.1))]
    assert spans(panels[0], "sensor fault") == [pytest.approx((0.905, 1.0))]
    assert all(len(spans(panel)) == 2 for panel in panels)
    legend = [text.get_text() for text in panels[0].get_legend().get_texts()]
    assert legend[-2:] == ["sensor not tared", "sensor fault"]


def test_a_healthy_sensor_is_not_marked(drawn_log):
    drawn_log["tared"].values[:] = 1.0
    drawn_log["sensor_fault"].values[:] = 0.0
    assert not any(spans(panel) for panel in draw_forces(drawn_log).canvas.axes)


TICKS = np.linspace(0.0, 10.0, 501)


PHASES = ["grip", "lead", "align", "insert", "release", "leave", "done"]


@pytest.fixture(name="drawn")
def fixture_drawn():
    gap = np.interp(TICKS, [0.0, 4.0, 5.0, 6.0], [0.5, 0.02, 0.012, 0.0])
    drawn, unit = RunLog(TICKS), np.ones(6)
    drawn.add("seat_gap", np.column_stack([gap, gap]), "m")
    drawn.add("seat_offset", 1e-4 * np.ones_like(TICKS), "m")
    for name in ("frame_force", "magazine_force"):
        drawn.add(name, np.outer(TICKS > 5.0, [0.0, 3.0, 4.0]), "N")
    drawn.add("gripper_wrench", np.outer(TICKS, unit), "N, Nm")
    drawn.add("held", TICKS < 7.0, "1")
    drawn.add("hand_wrench", np.outer(np.sin(TICKS), unit), "N, Nm")
    drawn.add("phase", np.minimum(TICKS / 1.5, 6.0).astype(int), "1", PHASES)
    for name in ("eta", "eta_p"):
        drawn.add(name, 0.1 * TICKS, "m")
    for name, size in (("xi", 2), ("phi", 3)):
        drawn.add(name, np.outer(TICKS, 1e-3 * np.ones(size)), "m" if size == 2 else "rad")
        drawn.add(f"{name}_p", np.outer(TICKS, 2e-3 * np.ones(size)), "m")
    drawn.add("manifold_force", np.outer(TICKS, np.arange(1.0, 7.0)), "N, Nm")
    drawn.add("damping", np.outer(3000.0 - 100.0 * TICKS, unit), "N s/m")
    drawn.add("tau_d", np.outer(TICKS, np.arange(1.0, 7.0)), "Nm")
    return drawn


def test_the_damping_is_drawn_over_the_arc_length(drawn):
    assert draw_damping(drawn)
    (line,) = draw_damping(drawn).canvas.axes[0].lines
    np.testing.assert_allclose(line.get_xdata(), 0.1 * TICKS)
    np.testing.assert_allclose(line.get_ydata(), 3.0 - 0.1 * TICKS)  # kNs/m
    drawn.signals["damping"].values[:] = 90.0
    assert draw_damping(drawn) is None


@pytest.fixture(name="log")
def fixture_log():
    log = RunLog(np.linspace(0.0, 1.0, 5))
    log.add(
        "notch_position",
        [[0, 0], [1e-3, 0], [2e-3, -1e-3], [np.nan, np.nan], [-3e-3, 1e-3]],
        "m",
        ["left", "above"],
        2e-3,
    )
    return log


def test_left_is_left(log):
    (panel,) = draw_notch_position(log).canvas.axes
    way = panel.lines[0]
    np.testing.assert_allclose(way.get_xdata(), [0.0, -1.0, -2.0, np.nan, 3.0])
    np.testing.assert_allclose(way.get_ydata(), [0.0, 0.0, -1.0, np.nan, 1.0])
    assert "mm" in panel.get_xlabel() and "mm" in panel.get_ylabel()


def test_free_circle_and_all_of_the_way_are_in_the_picture(log):
    (panel,) = draw_notch_position(log).canvas.axes
    circle = next(line for line in panel.lines if line.get_label() == "free of contact")
    np.testing.assert_allclose(np.hypot(circle.get_xdata(), circle.get_ydata()), 2.0)
    low, high = panel.get_xlim()
    assert low < -3.0 and high > 3.0 and panel.get_ylim() == (low, high)


def test_is_drawn_when_logged(log):
    log.add("y_t", np.zeros((5, 3)), "m")
    assert "notch" in [drawing.name for drawing in draw_figures(log, [np.zeros((2, 3))])]
