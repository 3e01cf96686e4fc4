"""Figures of forces on the tool, drawn from made-up logs."""

import numpy as np
import pytest

from experiments.figures.all import draw_figures
from experiments.figures.coordinates import draw_progress
from experiments.figures.forces import draw_force_map, draw_forces, draw_pressing
from experiments.results.run_log import RunLog
from tests.shades import spans

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
        "Force measured, world axes",
        "Moment measured, world axes",
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
    assert set(lines(panel)) == {"acting", "$f_x$", "$f_y$", "$f_z$"}
    np.testing.assert_allclose(lines(panel)["$f_x$"][PUSH], 33.0)
    dashed = [line for line in panel.lines if line.get_linestyle() == "--"]
    np.testing.assert_allclose(dashed[0].get_ydata()[PUSH], 30.0)
    assert len(dashed) == 3
    assert panel.lines[-3:] == dashed  # on top, noise does not hide it


def test_moments_that_are_noise_are_left_out(drawn_log):
    for name in ("manifold_force", "wrench_ext", "wrench_measured"):
        drawn_log[name].values[:, 3:] = 0.01  # Nm, as 30 N have at a lever of a third of a mm
    assert [title.split()[0] for title in titles(draw_forces(drawn_log))] == ["Force", "Force"]


def test_position_only_has_no_moments(drawn_log):
    drawn_log.add("manifold_force", np.ones((201, 3)), "N", ["tau_par", "tau_perp", "tau_cross"])
    assert titles(draw_forces(drawn_log))[1] == "Force measured, world axes"


def test_acting_alone(drawn_log):
    drawn_log.signals = {"wrench_ext": drawn_log["wrench_ext"]}
    drawing = draw_forces(drawn_log)
    assert titles(drawing) == ["Force acting, world axes", "Moment acting, world axes"]
    np.testing.assert_allclose(lines(drawing.canvas.axes[0])["$f_x$"][PUSH], 30.0)
    assert drawing.caption == "The wrench that acts at the tool point."


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


def test_pushes_are_marked_in_other_figures(drawn_log):
    panels = draw_progress(drawn_log).canvas.axes
    assert spans(panels[0], "tool pushed") == [pytest.approx((0.405, 0.6))]
    assert all(len(spans(panel)) == 1 for panel in panels)
    force = drawn_log["wrench_ext"].values
    force[100:103] = 0.0  # a break of less than a fiftieth of the run
    assert len(spans(draw_progress(drawn_log).canvas.axes[0], "tool pushed")) == 1
    force[100:106] = 0.0
    assert len(spans(draw_progress(drawn_log).canvas.axes[0])) == 2
    del drawn_log.signals["wrench_ext"]
    assert not any(spans(panel) for panel in draw_progress(drawn_log).canvas.axes)


TIME = np.linspace(0.0, 2.0, 201)


@pytest.fixture(name="log")
def fixture_log():
    log = RunLog(TIME)
    force = np.where(TIME < 0.5, 0.0, 19.0)
    log.add("normal_force", force[:, None], "N", ["f_n"])
    log.add("press", np.full((201, 1), 20.0), "N", ["press"])
    log.add("xi", np.full((201, 1), 2e-3), "m", ["xi"])
    log.add("eta", np.column_stack([0.1 * TIME, 0.0 * TIME]), "m", ["eta_1", "eta_2"])
    return log


def test_the_error_is_drawn_from_when_it_counts(log):
    error = draw_pressing(log).canvas.axes[1].lines[-1].get_ydata()
    assert np.isnan(error[TIME < 0.69]).all()
    np.testing.assert_allclose(error[TIME > 0.71], -1.0)


def test_the_map_has_the_force_where_it_touches(log):
    panel = draw_force_map(log).canvas.axes[0]
    (dots,) = panel.collections
    places = dots.get_offsets()
    assert places[:, 0].min() == pytest.approx(50.0)
    np.testing.assert_allclose(dots.get_array(), 19.0)
    assert dots.get_clim() == (18.0, 22.0)


def test_position_control_has_no_error(log):
    del log.signals["press"]
    assert len(draw_pressing(log).canvas.axes) == 2


def test_are_drawn_when_logged(log):
    names = [drawing.name for drawing in draw_figures(log, [np.zeros((2, 3))])]
    assert {"pressing", "force_map"} <= set(names)
